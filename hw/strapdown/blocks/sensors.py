"""The line sensors that the blocks know, as data: pixels, clocks, read-out and exposure."""

from dataclasses import dataclass

__all__ = ["SENSORS", "LineSensor"]


@dataclass(frozen=True)
class LineSensor:
    """A line sensor, and the preset of its line.

    Attributes
    ----------
    name, title : str
        Name in configurations; manufacturer and kind.
    protocol : str
        "sh_icg": the pins clock, SH and ICG; the pixels follow the rise of ICG. "st_clk": the pins clock and ST; the
        pixels follow the fall of ST. Clock edges of "st_clk": the sensor counts rising edges, and ST changes at falling
        ones.
    pixels, pitch_um : int, float
        Effective pixels, and their pitch.
    clock_hz_min, clock_hz_max, clock_hz : float
        Range of the sensor's clock, and the preset.
    clocks_per_pixel : int
        Clocks of a pixel slot.
    lead, slots : int
        Pixel slots before the first effective pixel, and those of a whole read-out. Slot 0 begins with the rise of ICG,
        or with the rising clock edge before the fall of ST.
    line_clocks, line_clocks_min, line_pause_s : int, int, float
        Clocks from line to line: the preset, and the least number, to which a time in seconds adds.
    exposure_min_s : float
        Least exposure.
    exposure_tail : int
        Clocks from the edge that ends a line, the fall of SH or ST, to the end of the exposure.
    shutter : bool
        True if the exposure may be shorter than the line. It begins with the last fall of SH before the transfer, or
        with the rise of ST. False if it is the line without the first ``reset_clocks`` clocks.
    reset_clocks : int
        Clocks at the begin of a line in which a sensor without a shutter does not expose.
    st_high_min, st_low_min : int
        Protocol "st_clk": least clocks of ST, high and low.
    sh_after_icg_s, sh_high_s, icg_after_sh_s, icg_in_clock_s : float
        Protocol "sh_icg", seconds: SH rises after ICG falls; SH is high; ICG rises after SH falls, at the first place
        that is so long after a rise of the clock, while the clock is high.
    flushes, flush_pitch_s : int, float
        Protocol "sh_icg": pulses of SH before that which begins an exposure, and their least distance in seconds.
    invert : bool
        True if the video falls with light.
    settle_s : float
        Time from the begin of a pixel slot until the video has settled.
    sample_at : float
        Preset of the instant at which the ADC samples, as a part of the pixel slot; later if the video settles later.
    adc : str
        Preset of the ADC: "spi" or "parallel".
    sources : tuple of str
        Where the figures come from.
    """

    name: str
    title: str
    protocol: str
    pixels: int
    pitch_um: float
    clock_hz_min: float
    clock_hz_max: float
    clock_hz: float
    clocks_per_pixel: int
    lead: int
    slots: int
    line_clocks: int
    line_clocks_min: int
    exposure_min_s: float
    invert: bool
    settle_s: float
    sample_at: float
    adc: str
    sources: tuple[str, ...]
    line_pause_s: float = 0.0
    exposure_tail: int = 0
    shutter: bool = True
    reset_clocks: int = 0
    st_high_min: int = 0
    st_low_min: int = 0
    sh_after_icg_s: float = 0.0
    sh_high_s: float = 0.0
    icg_after_sh_s: float = 0.0
    icg_in_clock_s: float = 0.0
    flushes: int = 0
    flush_pitch_s: float = 0.0


SENSORS = {sensor.name: sensor for sensor in (
    LineSensor(
        "tcd1304", "Toshiba TCD1304DG, CCD", "sh_icg", pixels=3648, pitch_um=8.0,
        clock_hz_min=0.8e6, clock_hz_max=4e6, clock_hz=2e6, clocks_per_pixel=4,
        # 16 dummy outputs, 13 shielded ones, 3 more dummies; 14 dummies after the effective ones.
        lead=32, slots=3694, line_clocks=14_800, line_clocks_min=14_792,
        exposure_min_s=10e-6, invert=True, settle_s=500e-9, sample_at=0.85, adc="spi",
        # SH rises between 100 and 1,000 ns after ICG falls. It is high for 1,000 ns or more; the second microsecond
        # leaves less charge behind. ICG rises 1,000 ns or more after SH falls, typically 5 us.
        sh_after_icg_s=500e-9, sh_high_s=2e-6, icg_after_sh_s=5e-6, icg_in_clock_s=50e-9, flushes=8,
        flush_pitch_s=10e-6,
        sources=("TCD1304DG data sheet, Rev. 1.4: timing charts, timing requirements",
                 "tcd1304.wordpress.com, timing requirements",
                 "esbenrossel/tcd1304_firmware_spi, timer_conf.c",
                 "settling time: assumed, half a pixel at 4 MHz")),
    LineSensor(
        "s11639", "Hamamatsu S11639-01, CMOS", "st_clk", pixels=2048, pitch_um=14.0,
        clock_hz_min=0.2e6, clock_hz_max=10e6, clock_hz=5e6, clocks_per_pixel=1,
        # The end-of-scan pulse follows the last pixel by two clocks.
        lead=88, slots=88 + 2048 + 2, line_clocks=2_500, line_clocks_min=2_145,
        exposure_min_s=0.0, exposure_tail=48, st_high_min=6, st_low_min=100, invert=False, settle_s=60e-9,
        sample_at=0.9, adc="parallel",
        sources=("drmcnelson/S11639-01-Linear-CCD-PCB-and-Code, S1163901_SPI.cpp: first pixel, exposure",
                 "OliverHasle/PIC24_ADC_Spectrometer, globals.h: first pixel, exposure, least high time of ST",
                 "least low time of ST, settling time: assumed, to be checked against the data sheet KMPD1163E")),
    LineSensor(
        "tsl1402", "ams TSL1402R, photodiode array", "st_clk", pixels=256, pitch_um=63.5,
        clock_hz_min=5e3, clock_hz_max=8e6, clock_hz=5e6, clocks_per_pixel=1,
        # ST is the pin SI. The rising clock edge while SI is high gives pixel 1; one more clock ends the line.
        lead=0, slots=257, line_clocks=1_000, line_clocks_min=257, line_pause_s=20e-6,
        exposure_min_s=0.0, shutter=False, reset_clocks=18, st_high_min=1, st_low_min=1, invert=False,
        settle_s=120e-9, sample_at=0.9, adc="parallel",
        sources=("TSL1402R data sheet DS000147: timing waveforms, integration time, settling time",
                 "osaboh/TSL1401_verilog")),
)}
"""The sensors, by name."""
