"""The one place where the streams of a Log become a Recording: rows at the gyro's samples.

Times come mended from ``clock``. Gaps between the gyro's samples are filled with samples on a line between their ends,
if the angles cannot suffer much. The specific force is taken from the same row, or interpolated from a clock of its
own. A sample of the field goes to the gyro's nearest sample, once. A value that a file repeats from row to row is one
sample.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .clock import Clock, gaps, mended
from .log import ACCEL, ATTITUDE, GYRO, MAG, POSITION, VELOCITY, Log, Stream, interpolated
from .recording import (
    STANDARD_GRAVITY,
    Recording,
    RecordingError,
    Reference,
    Timing,
    Track,
    check_gravity,
    mean_rate,
    unit_quaternions,
)
from .turning import AGREEMENT, RATIO, turning

__all__ = ["held", "recording_of", "recordings_of", "saturated"]

BRIDGED_S = 1.0
"""Longest gap that is bridged whatever the motion."""

LONGEST_BRIDGED_S, LARGEST_BRIDGED_DEG = 10.0, 5.0
"""Longest gap that is bridged at all, and the angle by which a line across a longer one than BRIDGED_S can be wrong."""

LARGEST_FAST_DEG = 90.0
"""Angle by which a line across any gap can be wrong."""

ENDS = 5
"""Samples at each end of a gap, whose mean is the rate there."""

SLOWEST_HZ = 1.0
"""Slowest rate of the samples: a slower one is time in a wrong unit."""


def recording_of(log: Log, *, imu: str | None = None, mag: str | None = None, start_s: float | None = None,
                 stop_s: float | None = None) -> Recording:
    """The Recording of a log.

    Parameters
    ----------
    log : Log
    imu, mag : str, optional
        Name or number of the inertial sensor and of the magnetometer; the first one by default.
    start_s, stop_s : float, optional
        Part of the log, in seconds from its first sample.

    Raises: RecordingError.
    """
    gyro = log.chosen(GYRO, imu, "--imu")
    if gyro is None:
        raise RecordingError(f"{log.path}: the log ({log.form}) has no gyro; record it too")
    forces = log.of(ACCEL)
    accel = next((stream for stream in forces if stream.name == gyro.name), forces[0] if forces else None)
    if accel is None:
        raise RecordingError(f"{log.path}: the log ({log.form}) has no accelerometer; record it too")
    field = log.chosen(MAG, mag, "--mag")

    clock = _clock(log, gyro, start_s, stop_s)
    rates, faults = gyro.values[clock.rows], dict(clock.faults)
    good = np.isfinite(rates).all(axis=1)
    if not good.all():
        faults["gyro samples that are not numbers, bridged"] = int((~good).sum())
        clock = clock._replace(rows=clock.rows[good], time_s=clock.time_s[good])
        rates = rates[good]
    if len(clock.rows) < 2:
        raise RecordingError(f"{log.path}: {len(clock.rows)} samples of the gyro; at least 2 are needed")
    time_s, own, bridged, longest, angle = _bridged(log, clock, rates, faults)
    recording = Recording(
        name=log.name, sample_rate_hz=log.rate_hz or mean_rate(time_s), time_s=time_s,
        gyro_deg_s=_on_line(time_s, clock.time_s, rates, own), **_force(gyro, accel, clock, time_s, own),
        **_field(gyro, field, clock, time_s, own), reference=_reference(log, time_s),
        position=_track(log, POSITION), velocity=_track(log, VELOCITY))
    notes = list(log.notes)
    if (new := recording.mag_new) is not None and recording.mag is not None and not recording.mag[~new].any():
        rate = new.sum() / (time_s[-1] - time_s[0] + 1 / recording.sample_rate_hz)
        if rate < 0.9 * recording.sample_rate_hz:
            notes.append(f"magnetometer: {int(new.sum())} samples, {rate:.3g} Hz; each is used once")
    if log.stamped:
        period = np.diff(time_s, append=2 * time_s[-1] - time_s[-2])
        recording = replace(recording, period_s=period, timing=Timing(
            faults=faults, bridged=tuple(bridged), longest_gap_s=longest, bridge_error_deg=angle,
            one_rate_error_deg=_one_rate_error(recording.gyro_deg_s, period, 1 / recording.sample_rate_hz)))
    check_gravity(log.path, recording)
    return replace(recording, notes=(*notes, *_statements(recording, gyro)))


def recordings_of(log: Log, count: int, **choice: Any) -> list[Recording]:
    """Recordings of up to ``count`` IMUs of a log, on the time axis of the first one, all with its magnetometer.

    An IMU counts if it has at least half the samples of the first. ``choice`` is that of ``recording_of``, where
    ``imu`` is the first one.

    Raises: RecordingError.
    """
    first = recording_of(log, **choice)
    gyro = log.chosen(GYRO, choice.get("imu"), "--imu")
    found = [first]
    for stream in log.of(GYRO):
        if len(found) < count and stream is not gyro and gyro and len(stream.time_s) >= len(gyro.time_s) / 2:
            other = recording_of(log, **(choice | {"imu": stream.name}))
            gyro_deg_s, accel = (interpolated(first.time_s, other.time_s, values)
                                 for values in (other.gyro_deg_s, other.accel))
            found.append(replace(first, name=f"{log.name}, {stream.name}", gyro_deg_s=gyro_deg_s, accel=accel,
                                 accel_unit=other.accel_unit))
    return found


def _clock(log: Log, gyro: Stream, start_s: float | None, stop_s: float | None) -> Clock:
    """The gyro's clock, mended and cut."""
    origin = _first_stamp(log, gyro)
    seconds = gyro.time_s - origin
    first, last = 0, len(seconds)
    if start_s is not None:
        first = int(np.argmax(seconds >= start_s)) if (seconds >= start_s).any() else len(seconds)
    if stop_s is not None and (seconds[first:] > stop_s).any():
        last = first + int(np.argmax(seconds[first:] > stop_s))
    if last - first < 2:
        raise RecordingError(f"{log.path}: {max(last - first, 0)} samples between --from and --to; the log goes from 0 "
                             f"to {np.nanmax(seconds):g} s")
    clock = mended(gyro.time_s[first:last])
    clock = clock._replace(rows=clock.rows + first)
    here = clock.time_s[-1] - origin
    if clock.restart is not None and (stop_s is None or stop_s > here + 1e-3):
        raise RecordingError(f"{log.path}: {log.place(clock.restart + first)}: time starts again, after {here:g} s: "
                             f"two recordings in one file; take the first with --to {_rounded(here, up=True)}, or "
                             "split "
                             "it there")
    if len(clock.time_s) < 2:
        raise RecordingError(f"{log.path}: {log.place(min(1, len(seconds) - 1))}: time does not increase")
    if log.stamped and (step := float(np.median(np.diff(clock.time_s)))) > 1 / SLOWEST_HZ:
        raise RecordingError(f"{log.path}: samples are {step:g} s apart; if that is ms or us, name the unit in the "
                             f"header, as in Time (ms), or with --columns time=NAME:ms")
    return clock


def _first_stamp(log, gyro):
    finite = gyro.time_s[np.isfinite(gyro.time_s)]
    if not len(finite):
        raise RecordingError(f"{log.path}: no sample of the gyro has a time stamp")
    return finite[0]


def _rounded(seconds, up=False):
    """Seconds for an option, with three decimals, not before (or after) the instant."""
    return f"{(math.ceil if up else math.floor)(seconds * 1000) / 1000:g}"


def _bridged(log, clock, rates, faults):
    """Time of all rows, where the gyro's own ones are among them, the bridged stretches, the longest of them, and the
    largest angle by which one of them can be wrong."""
    found = gaps(clock.time_s)
    if found.late:
        faults["late time stamps, used as they are"] = found.late
    added, bridged, longest, largest = [], [], 0.0, 0.0
    for gap in found.lost:
        length = gap.end_s - gap.start_s
        # The rate may have gone from one end's value to the other's at any instant.
        before, after = rates[max(gap.sample - ENDS, 0):gap.sample], rates[gap.sample:gap.sample + ENDS]
        angle = length * float(np.linalg.norm(after.mean(axis=0) - before.mean(axis=0))) / 2
        if (length > BRIDGED_S and (length > LONGEST_BRIDGED_S or angle > LARGEST_BRIDGED_DEG)) or \
                angle > LARGEST_FAST_DEG:
            raise RecordingError(_remedy(log, clock, found.lost, gap, length, angle))
        added.append(np.linspace(gap.start_s, gap.end_s, gap.lost + 2)[1:-1])
        bridged.append((gap.start_s, gap.end_s))
        longest, largest = max(longest, length), max(largest, angle)
    if not added:
        return clock.time_s, slice(None), bridged, longest, largest
    faults["gaps, bridged"] = len(bridged)
    faults["samples lost, filled in on a line"] = sum(len(times) for times in added)
    before = np.repeat([gap.sample for gap in found.lost], [len(times) for times in added])
    time_s = np.insert(clock.time_s, before, np.concatenate(added))
    own = np.ones(len(time_s), bool)
    own[before + np.arange(len(before))] = False
    return time_s, own, bridged, longest, largest


def _remedy(log, clock, lost, gap, length, angle):
    """Message on a gap that is not bridged: the options for the longest part without one."""
    origin = clock.time_s[0]
    ends = [0.0]
    for each in lost:
        if each.end_s - each.start_s > BRIDGED_S:
            ends += [each.start_s - origin, each.end_s - origin]
    ends.append(clock.time_s[-1] - origin)
    start, stop = max(zip(ends[::2], ends[1::2], strict=True), key=lambda part: part[1] - part[0])
    options = [f"--from {_rounded(start, up=False)}"] if start > 0 else []
    if stop < clock.time_s[-1] - origin:
        options.append(f"--to {_rounded(stop, up=True)}")
    wrong = f", across which the angles can be off by {angle:.0f}°" if length <= LONGEST_BRIDGED_S else ""
    return (f"{log.path}: {log.place(int(clock.rows[gap.sample]))}: gap of {length:.3g} s after "
            f"{gap.start_s - origin:.6g} s{wrong}; replay a part without it: {' '.join(options)} is the longest")


def _on_line(time_s, known_s, values, own):
    """Values at own rows, on lines between them at the others."""
    if isinstance(own, slice):
        return values
    return interpolated(time_s, known_s, values)


def _same_clock(gyro, stream):
    return stream.time_s is gyro.time_s or (len(stream.time_s) == len(gyro.time_s)
                                            and np.array_equal(stream.time_s, gyro.time_s, equal_nan=True))


def _present(values):
    """Rows that hold a sample: numbers that are not all zero."""
    return np.isfinite(values).all(axis=1) & (values != 0).any(axis=1)


class Held(NamedTuple):
    """Rows that hold a new sample, bool, shape (N,), and whether every sample of a slower sensor is repeated."""

    new: np.ndarray
    every: bool


def held(values: np.ndarray, present: np.ndarray) -> Held:
    """Which rows hold a new sample, where a slower sensor's values are repeated from row to row.

    A file repeats values if a tenth of its rows are repeats, and if values do not come back after a change, as those
    of a coarse sensor at rest do. A value that lasts longer than usual (nine tenths of the values end before) counts
    as new once in each usual time.
    """
    index = np.flatnonzero(present)
    new = present.copy()
    if len(index) < 4:
        return Held(new, False)
    rows = values[index]
    change = np.flatnonzero((rows[1:] != rows[:-1]).any(axis=1)) + 1
    lengths = np.diff(change)
    if len(lengths) < 3:
        return Held(new, False)
    usual = math.ceil(np.percentile(lengths, 90))
    repeats = int((lengths - 1).sum())
    returns = int(((rows[2:] == rows[:-2]).all(axis=1) & (rows[1:-1] != rows[:-2]).any(axis=1)).sum())
    if usual < 2 or repeats < 0.1 * lengths.sum() or returns > 0.05 * repeats:
        return Held(new, False)
    starts = np.zeros(len(rows), int)
    starts[change] = change
    since = np.arange(len(rows)) - np.maximum.accumulate(starts)
    new[index] = since % usual == 0
    return Held(new, bool(np.percentile(lengths, 10) >= 2))


def _force(gyro, accel, clock, time_s, own):
    """Specific force at all rows, zero where there is none, and its unit."""
    if _same_clock(gyro, accel):
        values = accel.values[clock.rows]
        present = _present(values)
        new, every = held(values, present)
        if not every:
            values = np.where(present[:, None], values, 0.0)
            if isinstance(own, slice):
                return {"accel": values, "accel_unit": accel.unit}
            both = np.interp(time_s, clock.time_s, present) == 1
            return {"accel": np.where(both[:, None], _on_line(time_s, clock.time_s, values, own), 0.0),
                    "accel_unit": accel.unit}
        known_s, values = clock.time_s[new], values[new]
    else:
        own_clock = mended(accel.time_s)
        values = accel.values[own_clock.rows]
        present = _present(values)
        new = held(values, present).new
        known_s, values = own_clock.time_s[new], values[new]
        known_s, values = _means(known_s, values, time_s)
    if len(known_s) < 2:
        return {"accel": np.zeros((len(time_s), 3)), "accel_unit": accel.unit}
    force = interpolated(time_s, known_s, values)
    # No sample for longer than a few of its own steps, and BRIDGED_S: the force is not known.
    limit = max(4 * float(np.median(np.diff(known_s))), BRIDGED_S / 4)
    after = np.searchsorted(known_s, time_s).clip(1, len(known_s) - 1)
    distance = np.where((time_s < known_s[0]) | (time_s > known_s[-1]),
                        np.maximum(known_s[0] - time_s, time_s - known_s[-1]), known_s[after] - known_s[after - 1])
    return {"accel": np.where((distance <= limit)[:, None], force, 0.0), "accel_unit": accel.unit}


def _means(known_s, values, time_s):
    """Samples of a faster sensor as means of groups, one for each row."""
    if len(known_s) < 1.5 * len(time_s):
        return known_s, values
    row = np.searchsorted((time_s[1:] + time_s[:-1]) / 2, known_s)
    first = np.flatnonzero(np.diff(row, prepend=-1))
    counts = np.diff(np.append(first, len(row)))
    return (np.add.reduceat(known_s, first) / counts, np.add.reduceat(values, first) / counts[:, None])


def _field(gyro, field, clock, time_s, own):
    """Field at all rows, zero where there is no new sample, and where it is new."""
    if field is None:
        return {"mag": None}
    mag, new = np.zeros((len(time_s), 3)), np.zeros(len(time_s), bool)
    if _same_clock(gyro, field):
        values = field.values[clock.rows]
        present = _present(values)
        fresh, every = held(values, present)
        new[own] = fresh
        # Repeats from one row to the next remain for cores that take no flags.
        mag[own] = np.where((fresh if every else present)[:, None], values, 0.0)
    else:
        own_clock = mended(field.time_s)
        values = field.values[own_clock.rows]
        fresh = held(values, _present(values)).new
        stamps, values = own_clock.time_s[fresh], values[fresh]
        step = float(np.median(np.diff(time_s)))
        inside = (stamps >= time_s[0] - step) & (stamps <= time_s[-1] + step)
        row = np.searchsorted((time_s[1:] + time_s[:-1]) / 2, stamps[inside])
        mag[row], new[row] = values[inside], True
    return {"mag": mag, "mag_new": new}


def _track(log, kind):
    """The first stream of a kind as a Track."""
    stream = next(iter(log.of(kind)), None)
    if stream is None:
        return None
    clock = mended(stream.time_s)
    good = np.isfinite(stream.values[clock.rows]).all(axis=1)
    return Track(clock.time_s[good], stream.values[clock.rows][good]) if good.any() else None


def _reference(log, time_s):
    """The first attitude of the log, on the recording's time axis."""
    attitude = next(iter(log.of(ATTITUDE)), None)
    if attitude is None:
        return None
    quaternion, valid = unit_quaternions(attitude.values)
    with np.errstate(invalid="ignore"):
        inside = (attitude.time_s >= time_s[0] - 1e-9) & (attitude.time_s <= time_s[-1] + 1e-9)
    return Reference(time_s=attitude.time_s, quaternion=quaternion, valid=valid & inside, frame=attitude.frame,
                     heading_known=attitude.heading_known, meaning=attitude.meaning)


def _one_rate_error(rates, period, mean):
    """Largest angle, degrees, by which one rate in place of the periods turns too far or too little."""
    angle = np.cumsum(rates * (period - mean)[:, None], axis=0)
    return float(np.linalg.norm(np.ptp(np.vstack([np.zeros(3), angle]), axis=0)))


def saturated(kind: str, values: np.ndarray) -> np.ndarray:
    """Which rows of a gyro (deg/s) or an accelerometer (m/s^2) are at an end of the range: bool, shape (N,).

    An axis is, where its largest magnitude occurs three times or more and is one of the ranges that sensors have.
    """
    size = np.abs(np.nan_to_num(values))
    largest = size.max(axis=0, initial=0.0)
    at_end = size == largest
    ratio = largest[:, None] / np.array(RANGES[kind])
    end = (at_end.sum(axis=0) >= 3) & ((ratio > 0.995) & (ratio < 1.005)).any(axis=1)
    return (at_end & end).any(axis=1)


RANGES = {GYRO: [scale * size for size in (125, 250, 500, 1000, 2000, 4000) for scale in (1.0, 0.98, 1.147)],
          ACCEL: [size * STANDARD_GRAVITY for size in (2, 4, 8, 16, 32)]}
"""Usual ranges, deg/s and m/s^2; 245 and 286.7 deg/s are those of some sensors called 250."""

LARGEST_RATE_DEG_S = 4000.0
"""Largest range of the gyros in such logs."""


def _statements(recording, gyro):
    """What the values themselves say about the sensors."""
    lines = []
    largest = float(np.abs(recording.gyro_deg_s).max())
    if largest > LARGEST_RATE_DEG_S:
        lines.append(f"rates up to {largest:,.0f} deg/s are more than any gyro of this kind measures: is the unit "
                     f"{gyro.unit}?")
    for kind, values, unit in (GYRO, recording.gyro_deg_s, "deg/s"), (ACCEL, recording.accel, "m/s²"):
        at_end = saturated(kind, values)
        if at_end.any():
            lines.append(f"{kind}: {int(at_end.sum()):,} samples at its largest value, "
                         f"{np.abs(values[at_end]).max():.6g} {unit}: beyond the sensor's range, the angles suffer")
    if (line := _contradiction(recording, gyro)) is not None:
        lines.append(line)
    return lines


def _contradiction(recording, gyro):
    """What the turning of the field, or else of the specific force, says about the rates, if they do not fit."""
    name, vectors = "specific force", recording.accel
    if recording.mag is not None and np.count_nonzero(recording.mag_new) > 1:
        new = recording.mag_new
        name, vectors = "field", interpolated(recording.time_s, recording.time_s[new], recording.mag[new])
    found = turning(recording.time_s, np.radians(recording.gyro_deg_s), vectors)
    if found is None or abs(found.agreement) < AGREEMENT:
        return None
    if found.ratio < 0:
        return f"the {name} turns against the rates: signs or axes of the two sensors contradict each other"
    if 1 / RATIO < found.ratio < RATIO:
        return None
    return f"the {name} turns {found.ratio:.2g} times as fast as the rates say: is the unit of the gyro {gyro.unit}?"
