"""The command ``strapdown batch``."""

from functools import partial
from pathlib import Path

import click

from strapdown.config import ConfigError

from .common import UserError, config_options, configuration, show_table, target_of, writing
from .jobs import job_options
from .logs import log_options
from .progress import progress_of_stages

__all__ = ["batch"]

SHOWN = 3
"""Names that a line lists at most."""


@click.command()
@click.argument("places", nargs=-1, required=True, metavar="FOLDER|GLOB...")
@config_options
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=Path("build/batch"),
              show_default=True, help="Folder for the table (CSV, Markdown), and for a folder of results of each log.")
@log_options
@click.option("--html", is_flag=True,
              help="Also write batch.html, one page with a figure over all logs, and the table, which can be sorted "
                   "and leads to the results of each log. It needs no network.")
@click.option("--build", type=click.Path(file_okay=False, path_type=Path), default=Path("build/sim"),
              show_default=True, help="Folder that keeps the compiled simulation models.")
@job_options
def batch(places, config_name, changes, output, choice, html, build, jobs, scheduler):
    """Replay many logs through one core in Verilator, several at a time, and compare them in one table.

    FOLDER is searched for logs of the formats of docs/recordings.md, and so are the folders in it; GLOB is a pattern,
    in quotes, as in 'flights/**/*.ulg'. Each log is replayed as by 'strapdown replay', into OUTPUT/logs/NAME. The core
    is compiled once, and gets the constants of each log's sample rate.

    A log that does not go in is a row with the reason, and the exit status is 1 then. A log is not run again if its
    files, the configuration, the options and the version of this program did not change: an interrupted batch goes on
    where it stopped, and a second one runs what is new. Logs that did not go in are read again.
    """
    from strapdown_sim.batch import find_logs, replay_batch, write_table
    from strapdown_sim.drivers.toolchain import SimulatorMissingError
    from strapdown_sim.jobs import JobsError, workers
    from strapdown_sim.page import MissingPlotlyError, require_plotly

    config, _, options = target_of(None, config_name, changes)
    logs, without = find_logs(places, output)
    if without:
        raise UserError(f"no file matches {without[0]!r}")
    configured = partial(configuration, config_name or config.name, changes)
    try:
        if html:
            require_plotly()
        with (progress_of_stages({"build": "generate and compile", "logs": "logs"}) as progress,
              writing(output, build), workers(jobs, scheduler) as pool):
            done = replay_batch(logs, configured, output, choice=choice, build=build, pool=pool,
                                command=("strapdown", "generate", *options), progress=progress)
    except (ConfigError, SimulatorMissingError, MissingPlotlyError, JobsError) as error:
        raise UserError(str(error)) from None
    if done.skipped:
        click.echo(f"strapdown: note: {_listed(done.skipped)}: no recordings, left out", err=True)
    if not done.rows:
        raise UserError(f"{', '.join(places)}: no logs of a known format")
    with writing(output):
        write_table(done, output, config, html=html)
    _show(done, output, html)


def _listed(names):
    """A number of files, and the first of their names."""
    more = ", ..." if len(names) > SHOWN else ""
    return f"{len(names)} file{'s' * (len(names) > 1)} ({', '.join(names[:SHOWN])}{more})"


def _show(done, output, html):
    """The short table at the end of a batch; the logs that did not go in. Raises: Exit."""
    from statistics import median

    good = [row for row in done.rows if not row["error"]]
    rows = [("logs", f"{len(good):,} of {len(done.rows):,} went in")]
    if done.kept:
        rows.append(("not run again", f"{done.kept:,}, which did not change"))
    rows += [("samples", f"{sum(row['samples'] for row in good):,}"),
             ("bits that differ from the twin", f"{(differing := sum(row['bits_differing'] for row in good)):,}")]
    for key, name in (("total_rms_deg", "RMS rotation angle to references"), ("inclination_rms_deg", "RMS inclination"),
                      ("float64_max_deg", "largest rotation angle to float64")):
        found = [row for row in good if row[key] is not None]
        if found:
            worst = max(found, key=lambda row: row[key])
            digits = ".6f" if key == "float64_max_deg" else ".2f"
            middle = median(row[key] for row in found)
            rows.append((name, f"median {middle:{digits}}°, largest {worst[key]:{digits}}°: {worst['file']}"))
    rows.append(("written to", str(output / ("batch.html" if html else "batch.md"))))
    show_table(rows)
    for row in done.rows:
        if row["error"]:
            click.echo(f"strapdown: {row['file']}: {row['error']}", err=True)
    if differing or len(good) < len(done.rows):
        raise click.exceptions.Exit(1)
