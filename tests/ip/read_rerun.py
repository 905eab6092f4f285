"""Reads a recording of the Rerun viewer by rerun-sdk, in its own environment: FILE.rrd to FILE.npz.

Each array of the archive is a column of an entity, ``ENTITY|COLUMN``; times are in nanoseconds.
"""

import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
from rerun.chunk import RrdReader


def numbers(column):
    """A column as an array, a row for each row."""
    if pa.types.is_duration(column.type) or pa.types.is_timestamp(column.type):
        return column.cast(pa.int64()).to_numpy(zero_copy_only=False)
    return np.array(column.to_pylist())


def main(path):
    found = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name != "rerun.controls.RowId":
                found.setdefault(f"{chunk.entity_path}|{name}", []).append(numbers(batch.column(name)))
                found[f"{chunk.entity_path}|{name}|type"] = [np.array([str(batch.column(name).type)])]
    np.savez(Path(path).with_suffix(".npz"), **{key: np.concatenate(arrays) for key, arrays in found.items()})


main(sys.argv[1])
