"""Writes a run as a recording of the Rerun viewer: attitude, curves, status bits and track on the log's time line."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from .curves import ESTIMATE, HARDWARE
from .extras import MissingExtraError
from .page import COLOURS, TO_ENU, Panel

__all__ = ["MissingRerunError", "require_rerun", "write_rerun"]

EPOCH_S = 5e8
"""A later time is one since 1970, not one since the start of a device."""

MOST_ROWS = 6
"""Most panels in one column."""


class MissingRerunError(MissingExtraError):
    """rerun-sdk is not installed."""


def require_rerun() -> None:
    """Raises: MissingRerunError if rerun-sdk is not installed."""
    if find_spec("rerun") is None:
        raise MissingRerunError("a recording for Rerun needs rerun-sdk: pip install 'strapdown[rerun]'")


def write_rerun(path: Path, *, title: str, time_s: np.ndarray, panels: Sequence[Panel],
                status: Mapping[str, np.ndarray], gaps: Sequence[tuple[float, float]] = (),
                attitudes: Mapping[str, np.ndarray] | None = None, frame: str = "NWU",
                tracks: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None) -> None:
    """Write the recording of a run, with a layout.

    The time line ``t`` has the times of the log. Numbers that are NaN are left out. Entities:

    - ``attitude/NAME``: rotations from body to navigation frame, with axes;
    - ``curves/TITLE/NAME``: a scalar for each sample of a curve, by the title of its panel;
    - ``status/NAME``: 0 or 1, where a status bit changes, and at both ends;
    - ``track/NAME``: latitude and longitude, and ``track/NAME/line`` the whole of it;
    - ``gaps``: a line of text at the begin of each gap.

    Parameters
    ----------
    path : Path
        File to write.
    title, time_s, panels, status, gaps, frame
        See ``write_page``.
    attitudes : dict, optional
        Maps names to quaternions, body to navigation frame, scalar first, shape (N, 4).
    tracks : dict, optional
        Maps names to times, shape (M,), and to latitude and longitude in degrees, shape (M, 2).

    Raises: MissingRerunError.
    """
    require_rerun()
    # It takes a second to import, and is an extra.
    import rerun as rr

    recording = rr.RecordingStream("strapdown")
    recording.save(path, default_blueprint=_layout(panels, attitudes, tracks, gaps))
    recording.send_recording_name(title)

    def send(entity, times, columns):
        if len(times):
            recording.send_columns(entity, indexes=[_time(times)], columns=columns)

    if attitudes:
        down = TO_ENU[frame][2][2] < 0
        view = rr.ViewCoordinates.RIGHT_HAND_Z_DOWN if down else rr.ViewCoordinates.RIGHT_HAND_Z_UP
        recording.log("attitude", view, static=True)
        recording.log("attitude/directions", rr.Arrows3D(vectors=TO_ENU[frame], labels=["E", "N", "up"],
                                                         colors=[153, 153, 153]), static=True)
    for (name, quaternion), size in zip((attitudes or {}).items(), (1.0, 0.7), strict=False):
        known = np.isfinite(quaternion).all(axis=1)
        # Its scalar is last.
        turns = np.roll(quaternion[known], -1, axis=1)
        send(f"attitude/{name}", time_s[known], rr.Transform3D.columns(quaternion=turns))
        recording.log(f"attitude/{name}", rr.TransformAxes3D(size), static=True)
    for panel in panels:
        for place, curve in enumerate(panel.curves):
            entity = _entity("curves", panel.title, curve.name)
            known = np.isfinite(curve.values)
            send(entity, time_s[known], rr.Scalars.columns(scalars=np.asarray(curve.values, float)[known]))
            look = {"colors": _rgb(curve.colour or COLOURS[place % len(COLOURS)]), "names": curve.name}
            recording.log(entity, rr.SeriesPoints(marker_sizes=1.5, **look) if curve.points else
                          rr.SeriesLines(widths=curve.width, **look), static=True)
    for name, bits in status.items():
        rows = np.unique([0, *(np.flatnonzero(np.diff(bits)) + 1), len(bits) - 1])
        send(_entity("status", name), time_s[rows], rr.Scalars.columns(scalars=bits[rows].astype(float)))
        recording.log(_entity("status", name), rr.SeriesLines(
            names=name, interpolation_mode=rr.components.InterpolationMode.StepAfter), static=True)
    for name, (times, places) in (tracks or {}).items():
        send(f"track/{name}", times, rr.GeoPoints.columns(positions=places))
        recording.log(f"track/{name}/line", rr.GeoLineStrings(lat_lon=[places], colors=_rgb(
            HARDWARE if name == "hardware" else ESTIMATE)), static=True)
    if gaps:
        send("gaps", np.array([start for start, _ in gaps]), rr.TextLog.columns(
            text=[f"gap of {1000 * (end - start):.4g} ms, filled in" for start, end in gaps]))
    recording.flush()
    recording.disconnect()


def _time(times):
    """A column of the time line: times since 1970, or since the log's own zero."""
    import rerun as rr

    nanoseconds = np.rint(1e9 * np.asarray(times, float)).astype(np.int64)
    if len(nanoseconds) and nanoseconds[0] > 1e9 * EPOCH_S:
        return rr.TimeColumn("t", timestamp=nanoseconds.astype("datetime64[ns]"))
    return rr.TimeColumn("t", duration=nanoseconds.astype("timedelta64[ns]"))


def _entity(*parts):
    """Path of an entity; names may have any characters."""
    import rerun as rr

    return rr.new_entity_path(list(parts))


def _rgb(colour):
    """The three numbers of a colour in hexadecimal digits."""
    return [int(colour[place:place + 2], 16) for place in (1, 3, 5)]


def _layout(panels, attitudes, tracks, gaps):
    """Attitude and map at the left; at the right the panels, and the status bits below them."""
    import rerun.blueprint as rrb

    left: list[Any] = [rrb.Spatial3DView(origin="attitude", name="attitude")] if attitudes else []
    left += [rrb.MapView(origin="track", name="track")] if tracks else []
    left += [rrb.TextLogView(origin="gaps", name="gaps")] if gaps else []
    views = [rrb.TimeSeriesView(origin=_entity("curves", panel.title), name=panel.title) for panel in panels]
    views.append(rrb.TimeSeriesView(origin="status", name="status"))
    return rrb.Blueprint(rrb.Horizontal(
        rrb.Vertical(*left), rrb.Grid(*views, grid_columns=-(-len(views) // (MOST_ROWS + 1))), column_shares=[1, 3]))
