"""Models of line sensors and ADCs at their pins, in Verilog-2001: limits of the data sheets, and names of the rules."""

from dataclasses import dataclass, field
from importlib.resources import files

__all__ = ["ADCS", "SENSORS", "PinModel"]


@dataclass(frozen=True)
class PinModel:
    """A Verilog model, and the values of its parameters.

    Attributes
    ----------
    title : str
        Name of the part.
    module : str
        Module, and file without its suffix.
    rules : tuple of str
        Rules of the data sheet. A violation has the number of its rule; the first is 1. An empty one is not checked.
    parameters : dict
        Parameters that differ from the module's defaults.
    settle_ns, guard_ns : int
        Of a sensor, for the ADC behind it: time that the video takes to settle, and least distance of an edge of SH
        from a sample; 0: none.
    """

    title: str
    module: str
    rules: tuple[str, ...]
    parameters: dict[str, int] = field(default_factory=dict)
    settle_ns: int = 0
    guard_ns: int = 0

    @property
    def text(self):
        """The Verilog text."""
        return (files(__package__) / f"{self.module}.v").read_text(encoding="utf-8")

    def instance(self, name, ports, **parameters):
        """An instance in Verilog; ``ports`` maps ports to expressions, ``parameters`` are added to the model's."""
        def listed(values):
            return ", ".join(f".{key}({value})" for key, value in values.items())

        return f"  {self.module} #({listed(self.parameters | parameters)})\n      {name} ({listed(ports)});\n"


_SH_ICG = (
    "period of phiM", "ICG falls, SH rises: t2", "SH high: t3", "SH falls, ICG rises: t1",
    "ICG rises while phiM is high", "least exposure", "ICG falls only after the read-out",
    "one SH pulse while ICG is low")
_LINE = "a line begins only after the read-out"

SENSORS = {
    # 0.8 to 4 MHz. Half a pixel at 4 MHz is taken as the time to settle: the data sheet has no figure.
    "tcd1304": PinModel("TCD1304", "ccd_sh_icg", _SH_ICG, {"INVERT": 1}, settle_ns=500, guard_ns=50),
    # 0.2 to 10 MHz. The least times of ST are usual figures; the data sheet was not seen.
    "s11639": PinModel("S11639", "ccd_st_clk", ("period of CLK", "", "ST high", "ST low", "", _LINE), settle_ns=60),
    # Data sheet: to 8 MHz; pulses of CLK 50 ns; setup 20 ns, hold 0 ns; settles to 1 % in 120 ns; 20 us between lines.
    "tsl1402": PinModel("TSL1402", "ccd_st_clk", (
        "period of CLK", "CLK high, CLK low", "", "", "setup and hold of SI", _LINE), {
        "PIXELS": 256, "LEAD": 0, "START_SAMPLED": 1, "EXPOSURE_CLOCKS": 18, "CLOCK_MIN": 125, "CLOCK_MAX": 200_000,
        "PULSE_MIN": 50, "LINE_MIN": 257, "LINE_EXTRA": 20_000}, settle_ns=120),
}
"""Line sensors, by the names of the presets."""

ADCS = {
    "spi": PinModel("AD7476A", "adc_ad7476a", (
        "period of SCLK", "SCLK high, SCLK low", "CS falls, SCLK falls: t2", "CS high: t1", "quiet time",
        "1 MS/s", "16 SCLK a conversion", "video has settled", "video holds", "no edge of SH at a sample")),
    "parallel": PinModel("parallel ADC", "adc_parallel", (
        "period of CLK", "CLK high, CLK low", "video has settled", "video holds", "no edge of SH at a sample")),
}
"""ADCs, by their interface."""
