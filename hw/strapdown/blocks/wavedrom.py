"""Timing diagrams as text for WaveDrom, from the cycles of a LineTiming."""

import json

__all__ = ["columns_of_line", "wave_of_line"]


def columns_of_line(timing):
    """The events of a read-out, and of an exposure of the least length: maps each cycle to its events, in order.

    Parameters
    ----------
    timing : LineTiming
    """
    events = dict(timing.events)
    events["exposure begins"] = (events["exposure ends"] - timing.exposure_range[0]) % timing.line_cycles
    if "ICG falls" in events:
        events["flush"] = events["exposure begins"] - timing.flush_slots[0] * timing.slot_cycles
    columns: dict[int, list[str]] = {}
    for name, cycle in sorted(events.items(), key=lambda item: item[1]):
        columns.setdefault(cycle, []).append(name)
    return columns


def wave_of_line(timing):
    """The read-out of a line, and an exposure of the least length, as WaveJSON.

    Parameters
    ----------
    timing : LineTiming

    Returns: str. Times are not to scale: each column begins with events of ``columns_of_line``, and has their number.
    """
    columns = columns_of_line(timing)
    cycle_of = {name: cycle for cycle, names in columns.items() for name in names}

    def lane(title, start, **changes):
        """A lane, with its levels from the events on."""
        level, wave = start, ""
        for names in columns.values():
            before, level = level, next((changes[key] for name in names if (key := name.replace(" ", "_")) in changes),
                                        level)
            wave += "." if wave and level == before else level
        return {"name": title, "wave": wave}

    if "ICG falls" in cycle_of:
        pins = [lane("ICG", "1", ICG_falls="0", ICG_rises="1", next_line="0"),
                lane("SH", "0", SH_rises="1", SH_falls="0", flush="1", exposure_begins="0")]
    elif timing.sensor.shutter:
        pins = [lane("ST", "1", ST_falls="0", exposure_begins="1")]
    else:
        pins = [lane("SI", "1", ST_falls="0", ST_rises="1")]
    lanes = [*pins, {**lane("video", "x", first_pixel="=", read_out_ends="x"), "data": ["pixels"]},
             {**lane("sample", "0", first_sample="=", last_sample="0"), "data": ["one a pixel"]},
             lane("exposing", str(int(cycle_of["exposure ends"] < cycle_of["exposure begins"])), exposure_ends="0",
                  exposure_begins="1")]
    rows = ",\n  ".join(json.dumps(row) for row in lanes)
    return (f'{{"signal": [\n  {rows}],\n "config": {{"hscale": 2}},\n'
            f' "head": {json.dumps({"text": timing.sensor.title, "tick": 0})}}}')
