"""CSV files with a column of time in seconds, and units in the header."""

from .recording import Recording, RecordingError, check_time, mean_rate
from .table import TIME, read_table, require, sensors

__all__ = ["read_plain_csv"]


def read_plain_csv(path):
    """The Recording in a CSV file with its own time. Raises: RecordingError."""
    table = read_table(path)
    require(table, [TIME])
    if (unit := table.units[TIME]) != "s":
        raise RecordingError(f"{table.path}: column {TIME!r}: unit {unit or 'missing'!r} is not known; "
                             "time is in seconds, (s)")
    time_s = table[TIME]
    check_time(table.path, time_s, lambda row: f"line {table.lines[row]}")
    return Recording(name=table.path.stem, sample_rate_hz=mean_rate(time_s), time_s=time_s,
                     reference=None, **sensors(table))
