"""Progress bars, on standard error."""

__all__ = ["progress_bars"]


def progress_bars():
    """A rich ``Progress``, a context manager: a bar has a description, a count and the elapsed time.

    Nothing is shown if standard error is not a terminal, so that an error is its only line.
    """
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    return Progress(TextColumn("{task.description:<22}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
                    console=console, disable=not console.is_terminal)
