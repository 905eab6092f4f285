"""A LiteX SoC with the module of docs/ip.md: python litex_soc.py PACKAGE NAME, in the environment of LiteX."""

import sys

from ins import Ins
from litex.build.generic_platform import Pins, Subsignal
from litex.build.xilinx import XilinxPlatform
from litex.gen import LiteXModule
from litex.soc.integration.builder import Builder
from litex.soc.integration.soc import SoCRegion
from litex.soc.integration.soc_core import SoCMini
from migen import ClockDomain


class ClockReset(LiteXModule):
    """The clock and the reset of the board."""

    def __init__(self, platform):
        self.cd_sys = ClockDomain()
        self.comb += self.cd_sys.clk.eq(platform.request("clk")), self.cd_sys.rst.eq(platform.request("rst"))


folder, name = sys.argv[1:]
platform = XilinxPlatform("xc7a35ticsg324-1L", [
    ("clk", 0, Pins("E3")), ("rst", 0, Pins("D9")),
    ("serial", 0, Subsignal("tx", Pins("D10")), Subsignal("rx", Pins("A9")))], toolchain="vivado", name="board")
# A PC is the master of the bus, over the serial line.
soc = SoCMini(platform, clk_freq=100e6, with_uartbone=True)
soc.crg = ClockReset(platform)
soc.ins = Ins(platform, name, folder)
soc.bus.add_slave("ins", soc.ins.bus, SoCRegion(origin=0x4000_0000, size=0x1000, cached=False))
Builder(soc, output_dir="build", csr_csv="map.csv", compile_software=False).build(run=False)
