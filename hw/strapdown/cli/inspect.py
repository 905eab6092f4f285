"""The command ``strapdown inspect``."""

from pathlib import Path

import click

from .common import UserError, command_line, show_table, writing
from .logs import log_options

__all__ = ["inspect"]


@click.command()
@click.argument("recording", type=click.Path(exists=True, path_type=Path))
@log_options
@click.option("--picture", type=click.Path(dir_okay=False, path_type=Path),
              help="PNG file for the picture.  [default: build/inspect/NAME.png]")
def inspect(recording, choice, picture):
    """Show what is in RECORDING: streams, rates, gaps, ranges, and what a replay would use.

    RECORDING is a log of one of the formats of docs/recordings.md.
    """
    from strapdown_sim.inspection import inspect as facts_of
    from strapdown_sim.inspection import inspection_picture
    from strapdown_sim.recordings import RecordingError, read_log, recording_of

    try:
        log = read_log(recording, **choice.reading)
    except RecordingError as error:
        raise UserError(str(error)) from None
    used, refusal = None, None
    try:
        used = recording_of(log, **choice.merging)
    except RecordingError as error:
        refusal = str(error)
    show_table([("file", str(recording)), ("format", log.form)])
    for stream, facts in zip(log.streams, facts_of(log), strict=True):
        click.echo("")
        show_table(_stream_rows(stream, facts))
    click.echo("")
    show_table(_replay_rows(used, recording))
    for note in (used or log).notes:
        click.echo(f"strapdown: note: {note}", err=True)
    picture = picture or Path("build/inspect") / f"{log.name}.png"
    with writing(picture):
        picture.parent.mkdir(parents=True, exist_ok=True)
        inspection_picture(picture, log, used)
    show_table([("picture", str(picture))])
    if refusal is not None:
        raise UserError(f"replay would refuse it: {refusal}")


def _stream_rows(stream, facts):
    from strapdown_sim.inspection import UNITS

    rows = [(stream.kind, stream.name + (f", in {stream.unit}" if stream.unit else ""))]
    if facts.samples < 2:
        return [*rows, ("  samples", f"{facts.samples}")]
    rows = [*rows,
            ("  samples", f"{facts.samples:,}, {facts.rate_hz:.4g} Hz"),
            ("  gaps", f"{facts.lost:,} samples lost, longest gap {1000 * facts.longest_gap_s:.4g} ms" if facts.lost
             else "none")]
    rows += [(f"  {name}", f"{count:,}") for name, count in facts.faults.items()]
    if stream.kind == "attitude":
        return [*rows, ("  meaning", stream.meaning)]
    unit = "in units of the device" if stream.unit == "a.u." else UNITS[stream.kind]
    ranges = ", ".join(f"{low:.4g} to {high:.4g}" for low, high in zip(facts.lowest, facts.highest, strict=True))
    rows.append(("  range", f"{ranges} {unit}".strip()))
    if stream.kind in ("accel", "mag"):
        name = "  field strength" if stream.kind == "mag" else "  length"
        rows.append((name, f"{facts.length[0]:.4g} ± {facts.length[1]:.2g} {unit}"))
    if stream.kind in ("gyro", "accel"):
        rows.append(("  saturated", f"{facts.saturated:,} samples"))
    return rows


def _replay_rows(used, recording):
    """What a replay would use of the file ``recording``."""
    from strapdown_sim.magnetometer import field_facts, field_rows

    if used is None:
        return [("replay", "would refuse the log")]
    rows = [("replay would use", f"{len(used.time_s):,} samples, {used.sample_rate_hz:.6g} Hz"),
            ("  period", "of each sample" if used.period_s is not None else "one, from the rate"),
            ("  magnetometer", "none" if used.mag is None else f"{int(used.mag_new.sum()):,} samples"),
            ("  reference", used.reference.meaning if used.reference else "none")]
    if used.timing is not None:
        rows += [(f"  {name}", f"{count:,}") for name, count in used.timing.faults.items()]
        rows.append(("  with one rate", f"angles can be off by {used.timing.one_rate_error_deg:.2g}°"))
    return [*rows, *field_rows(field_facts(used), command_line("calibrate", "sensors", recording))]
