"""The module of docs/ip.md in LiteX: the SoC is elaborated, and its instance fits the Verilog of the package."""

import re
import subprocess

import pytest

from strapdown.tools import ToolError
from strapdown_lab.synthesis import run_yosys

pytestmark = pytest.mark.ip


def snippet(root):
    """The module on the page."""
    page = (root / "docs" / "ip.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(from litex.*?)^```", page, re.MULTILINE | re.DOTALL)
    return code


def elaborate(root, package, folder, code):
    """Elaborates the SoC with the code of the module, and checks its instances against the Verilog of the core."""
    (folder / "ins.py").write_text(code, encoding="utf-8")
    (folder / "soc.py").write_bytes((root / "tests" / "ip" / "litex_soc.py").read_bytes())
    done = subprocess.run([root / ".venv-litex" / "bin" / "python", "soc.py", package.folder, package.places.name],
                          cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    gateware = folder / "build" / "gateware"
    (gateware / "core.v").write_bytes((package.folder / package.places.verilog).read_bytes())
    run_yosys("read_verilog board.v; read_verilog -lib core.v; hierarchy -check -top board; stat", gateware)
    return (gateware / "board.v").read_text(encoding="utf-8"), (gateware / "board.tcl").read_text(encoding="utf-8")


def test_module_of_the_page(root, packages, tmp_path):
    package = packages("quaternion_j3", streams=False)
    verilog, script = elaborate(root, package, tmp_path, snippet(root))
    (instance,) = re.findall(rf"^{package.places.name} {package.places.name}\((.*?)^\);", verilog, re.M | re.S)
    assert set(re.findall(r"\.(\w+)\b", instance)) == {port.name for port in package.top.ports}
    assert str(package.folder / package.places.verilog) in script
    described = (tmp_path / "map.csv").read_text(encoding="utf-8")
    assert "memory_region,ins,0x40000000,4096,io" in described
    assert set(re.findall(r"csr_register,ins_(\w+)", described)) == {"ev_status", "ev_pending", "ev_enable"}


def test_a_port_that_the_core_does_not_have_is_found(root, packages, tmp_path):
    package = packages("quaternion_j3", streams=False)
    with pytest.raises(ToolError, match="does not have a port named 'rst_n'"):
        elaborate(root, package, tmp_path, snippet(root).replace("i_aresetn", "i_rst_n"))
