"""Options of commands that run jobs, and their errors."""

import os

import click

__all__ = ["job_options"]


def job_options(function):
    """The options that say where jobs run: arguments ``jobs`` and ``scheduler`` of the command."""
    function = click.option(
        "--scheduler", metavar="ADDRESS",
        help="Run the jobs on the workers of a Dask cluster, as in --scheduler tcp://10.0.0.1:8786. Needs "
             "strapdown[cluster].")(function)
    return click.option("--jobs", type=click.IntRange(1), default=os.cpu_count(), show_default="number of processors",
                        help="Number of jobs that run at the same time on this machine.")(function)
