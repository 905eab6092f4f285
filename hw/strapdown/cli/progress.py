"""Progress bars, on standard error."""

__all__ = ["progress_bars"]


def progress_bars():
    """A rich ``Progress``, a context manager: a bar has a description, a count and the time passed."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    return Progress(TextColumn("{task.description:<22}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                    console=Console(stderr=True))
