"""External programs, such as Yosys and g++: the error that is raised if one fails."""

__all__ = ["ToolError"]

OUTPUT_CHARACTERS = 3000
"""Number of characters, from the end, of a failed tool's output in the error message."""


class ToolError(RuntimeError):
    """A tool failed: its name, its exit status, and the end of its output.

    Parameters
    ----------
    tool : str
        Name of the tool.
    status : int
        Exit status.
    output : str
        Its output.

    Attributes
    ----------
    line : str
        The same in one line, with the first line of the output that contains "error", or else the last line.
    """

    def __init__(self, tool, status, output):
        output = output.strip()
        failed = f"{tool} failed with status {status}"
        super().__init__(f"{failed}:\n{output[-OUTPUT_CHARACTERS:]}")
        lines = output.splitlines() or ["no output"]
        self.line = f"{failed}: {next((line for line in lines if 'error' in line.lower()), lines[-1]).strip()}"
