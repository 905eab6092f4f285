"""Progress bars, on standard error."""

from contextlib import contextmanager

__all__ = ["progress_bars", "progress_of_stages"]


def progress_bars():
    """A rich ``Progress``, a context manager: a bar has a description, a count and the elapsed time.

    Nothing is shown if standard error is not a terminal, so that an error is its only line.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    return Progress(TextColumn("{task.description:<22}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                    console=console, disable=not console.is_terminal)


@contextmanager
def progress_of_stages(labels):
    """Context manager: a function ``progress(stage, done, total)`` that shows a bar for each stage that has begun.

    ``labels`` maps the stages to the descriptions of their bars.
    """
    with progress_bars() as bars:
        tasks = {}

        def progress(stage, done, total):
            if stage not in tasks:
                tasks[stage] = bars.add_task(labels[stage], total=total)
            bars.update(tasks[stage], completed=done)

        yield progress
