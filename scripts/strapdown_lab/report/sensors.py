"""Tables and timing diagrams of docs/sensors.md."""

from collections.abc import Iterator
from pathlib import Path

from strapdown.blocks import SENSORS, LineTiming
from strapdown.blocks.wavedrom import columns_of_line, wave_of_line
from strapdown.markdown import markdown_table
from strapdown_lab.waves import write_wave

__all__ = ["CLOCK_HZ", "sensor_blocks", "write_waves"]

CLOCK_HZ = 100e6


def _timings():
    return [LineTiming(sensor, clock_hz=CLOCK_HZ) for sensor in SENSORS.values()]


def _sensors():
    """What the sensors are, and the presets of their lines."""
    rows = []
    for timing in _timings():
        sensor = timing.sensor
        least, most = (1e6 * cycles / CLOCK_HZ for cycles in timing.exposure_range)
        rows.append([
            f"`{sensor.name}`", sensor.title, f"{sensor.pixels:,}", f"{sensor.pitch_um:g}",
            "φM, SH, ICG" if sensor.protocol == "sh_icg" else "CLK, ST" if sensor.shutter else "CLK, SI",
            f"{sensor.clock_hz_min / 1e6:g} to {sensor.clock_hz_max / 1e6:g}", f"{sensor.clock_hz / 1e6:g}",
            f"{CLOCK_HZ / timing.line_cycles:,.0f}",
            f"{least:,.1f} to {most:,.1f}" if sensor.shutter else f"{most:,.1f}",
            "falls" if sensor.invert else "rises", sensor.adc])
    return markdown_table(["sensor", "kind", "pixels:", "pitch, µm:", "pins", "clock, MHz", "preset, MHz:",
                           "lines per second:", "exposure, µs", "video with light", "ADC"], rows)


def _events():
    """The events of a line of each sensor."""
    timings = _timings()
    names = sorted({name for timing in timings for name in timing.events},
                   key=lambda name: (max(timing.events.get(name, -1) for timing in timings), name))
    return markdown_table(["event", *(f"`{timing.sensor.name}`:" for timing in timings)], [
        [name, *(f"{timing.events[name]:,}" if name in timing.events else "–" for timing in timings)]
        for name in names])


def _places():
    """What is constant in every slot of a sensor."""
    return markdown_table(["sensor", "cycles of a pixel:", "sample at cycle:", "cycles from an edge to a sample:"], [
        [f"`{timing.sensor.name}`", timing.slot_cycles, timing.sample_at, timing.guard] for timing in _timings()])


def _sources():
    return "\n".join(f"- `{sensor.name}`: {'; '.join(sensor.sources)}." for sensor in SENSORS.values())


def sensor_blocks():
    """Generated parts of docs/sensors.md, by the name of their block."""
    return {"sensors": _sensors(), "events": _events(), "places": _places(), "sources": _sources(),
            **{f"wave {timing.sensor.name}": _wave(timing) for timing in _timings()}}


def _wave(timing):
    """The diagram of a line, and the events of its columns."""
    name, columns = timing.sensor.name, columns_of_line(timing)
    return f"![Timing of the pins](sensors/{name}.svg)\n\n" + markdown_table(["column:", "events", "cycle:"], [
        [number, " and ".join(names), f"{cycle:,}"] for number, (cycle, names) in enumerate(columns.items())])


def write_waves(folder: Path) -> Iterator[Path]:
    """Draw the timing diagrams of all sensors into a folder, and yield their paths."""
    folder.mkdir(exist_ok=True)
    for timing in _timings():
        path = folder / f"{timing.sensor.name}.svg"
        write_wave(wave_of_line(timing), path)
        yield path
