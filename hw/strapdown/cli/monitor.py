"""The command ``strapdown monitor``."""

from pathlib import Path

import click

from .common import UserError, writing

__all__ = ["monitor"]


@click.command()
@click.argument("port")
@click.option("--baud", "baud_rate", type=click.IntRange(min=1), metavar="N",
              help="Open PORT as a serial port at this rate (needs pyserial). Without it, PORT keeps its settings.")
@click.option("--output", type=click.Path(dir_okay=False, path_type=Path), default=Path("nav.csv"), show_default=True,
              help="CSV file to write.")
@click.option("--plot", type=click.Path(dir_okay=False, path_type=Path), default=None, metavar="FILE",
              help="PNG file to draw at the end.")
@click.option("--every", type=click.IntRange(min=1), default=1, show_default=True, metavar="N",
              help="Updates from one frame to the next, so that the others do not count as lost.")
@click.option("--live", is_flag=True, help="Draw in a window while frames arrive.")
def monitor(port, baud_rate, output, plot, every, live):
    """Decode frames of SINS_uart or OPT_top from PORT: a serial port, a pseudo-terminal, or a recorded file.

    It ends at the end of the file, or with Ctrl-C.
    """
    from strapdown_sim.monitor import MonitorError, read_port
    from strapdown_sim.monitor import monitor as run

    if output.exists() and Path(port).exists() and output.samefile(port):
        raise UserError(f"--output would overwrite {port}, which is read")
    try:
        with writing(output, *filter(None, [plot])):
            counts = run(read_port(port, baud_rate), output, plot=plot, live=live, every=every)
    except MonitorError as error:
        raise UserError(str(error)) from None
    click.echo(f"{output}  {counts.frames} frames, {counts.lost} lost, {counts.crc_errors} CRC errors, "
               f"{counts.restarts} restarts, {counts.skipped_bytes} bytes skipped")
