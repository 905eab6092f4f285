"""`python -m strapdown_lab.faults`: flips bits of a core, and writes what follows from them."""

import json
from pathlib import Path

import click

from strapdown.cli.jobs import job_options
from strapdown.cli.progress import progress_bars
from strapdown.cores import CONFIGS
from strapdown.files import written_whole
from strapdown.tools import ToolError
from strapdown_sim.drivers.faults import Outcome
from strapdown_sim.drivers.toolchain import SimulatorMissingError
from strapdown_sim.jobs import JobsError
from strapdown_sim.recordings import RecordingError

from ..checkout import ROOT
from .campaign import Campaign, NothingChosenError, harmful
from .tables import WORDS, total


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--config", "name", default="thesis", show_default=True,
              type=click.Choice([name for name, config in CONFIGS.items() if not config.assemblies()]),
              help="The core: the main module of a configuration.")
@click.option("--count", type=click.IntRange(1), default=10_000, show_default=True, help="Number of flipped bits.")
@click.option("--seed", type=click.IntRange(0), default=1, show_default=True, help="Which bits, and when.")
@click.option("--only", default="", metavar="REGEX", help="Only registers and memories whose name matches.")
@click.option("--recordings", type=click.Path(file_okay=False, path_type=Path),
              default=ROOT.parent / "shared" / "recordings",
              help="Folder of the recordings. Without them the samples come from a generated flight.")
@click.option("--output", type=click.Path(file_okay=False, path_type=Path), default=ROOT / "build" / "faults",
              help="Folder for CONFIG.json, and for the verdicts from which an interrupted run continues.")
@job_options
def main(name, count, seed, only, recordings, output, jobs, scheduler):
    """Flip single bits in registers, memories and ROM of a core in Verilator, during a recording: docs/faults.md.

    The exit status is 1 if a core hangs, is out of step, or is stuck.
    """
    config = CONFIGS[name]
    try:
        with progress_bars() as bars:
            task = bars.add_task(name, total=count)
            report = Campaign(config, count, seed, only, recordings).run(
                output, jobs=jobs, scheduler=scheduler, progress=lambda done: bars.advance(task, done))
    except NothingChosenError as error:
        raise click.BadParameter(str(error), param_hint="--only") from None
    except (JobsError, RecordingError, SimulatorMissingError, ToolError) as error:
        raise click.ClickException(str(error)) from None
    except KeyboardInterrupt:
        raise click.ClickException("interrupted; the same command continues from here") from None
    path = output / f"{name}.json"
    with written_whole(path) as partial:
        partial.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    click.echo(f"{report['module']}, {report['samples']}: {report['faults']:,} of {report['bits']:,} bits, "
               "and those that a reset does not restore")
    for outcome in Outcome:
        click.echo(f"{WORDS[outcome]:14} {total(report, outcome):7,} {total(report, outcome, 'lasting'):7,}")
    click.echo(path)
    for fault in (found := harmful(report, config)):
        click.echo(f"{WORDS[Outcome[fault['outcome']]]}: {fault['place']}, row {fault['row']}, bit {fault['bit']}, "
                   f"round {fault['round']}, {fault['time']:.4f} of it", err=True)
    if found:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
