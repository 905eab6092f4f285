"""Comparison of attitude filters on real recordings: those of this project and published ones."""

import json
import os
from collections.abc import Callable
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from strapdown.cores import FLIGHT, FLIGHT_6AXIS, MAHONY, THESIS
from strapdown.markdown import markdown_table
from strapdown_sim.errors import (
    AttitudeErrors,
    attitude_errors,
    conjugate,
    enu_to_nwu,
    match_reference,
    multiply,
    quaternion_from_matrix,
    rms,
)
from strapdown_sim.jobs import completed, outcome, workers
from strapdown_sim.recordings import STANDARD_GRAVITY, read_recording
from strapdown_sim.reference.attitude import ComplementaryFilter, alignment
from strapdown_sim.truth import flight_filter

__all__ = ["FILTERS", "figure_table", "means", "measure", "write_accuracy"]

TUNED_ON = frozenset({
    "broad_02_undisturbed_slow_rotation_B", "broad_07_undisturbed_fast_rotation_B",
    "broad_16_undisturbed_fast_translation_B", "broad_25_disturbed_tapping_B",
    "broad_28_disturbed_stationary_magnet_A", "broad_34_disturbed_attached_magnet_3cm"})
"""Recordings on which parameters of the flight filter were chosen. Figures from them stand beside those from others."""

COLOURS = "#b8bcc4", "#8fc1ea", "#10243e", "#448855", "#e0a458", "#cc6633", "#9b6bb3"


def first_attitude(recording):
    """Attitude of the first sample, sensor to NWU, if it is at rest; without field x points north."""
    field = (1, 0, 0) if recording.mag is None else recording.mag[0]
    return quaternion_from_matrix(alignment(recording.accel[0], field))


def complementary(recording, *, config):
    """The thesis's filter with the gains of a configuration, sensors along body axes, from an aligned start."""
    model = ComplementaryFilter(kp=config.kp, ki=config.ki, period_s=1 / recording.sample_rate_hz)
    model.reset(first_attitude(recording))
    return quaternion_from_matrix(model.run(recording.accel, recording.mag, recording.gyro_deg_s).c_n2b)


def flight(recording):
    """The flight filter, with 6 axes if the recording has no magnetometer."""
    config = FLIGHT_6AXIS if recording.mag is None else FLIGHT
    model = flight_filter(config.replace(sample_rate_hz=recording.sample_rate_hz))
    return model.run(recording.accel, recording.mag, recording.gyro_deg_s).q_b2n


def vqf(recording, **settings):
    """VQF (Laidig and Seel, 2023), with its default settings but for those that are given."""
    from vqf import VQF

    samples = [np.radians(recording.gyro_deg_s), recording.accel]
    if recording.mag is not None:
        samples.append(recording.mag)
    model = VQF(1 / recording.sample_rate_hz, **settings)
    result = model.updateBatch(*(np.ascontiguousarray(s, dtype=float) for s in samples))
    return enu_to_nwu(result["quat6D" if recording.mag is None else "quat9D"])


def imufusion(recording):
    """Fusion (x-io Technologies), default settings; its earth frame is NWU by default."""
    from imufusion import Ahrs, AhrsSettings

    settings = AhrsSettings()
    settings.sample_rate = recording.sample_rate_hz
    model, quaternion = Ahrs(), np.empty((len(recording.time_s), 4))
    model.set_settings(settings)
    model.set_sample_period(1 / recording.sample_rate_hz)
    for k, (gyro, accel) in enumerate(zip(recording.gyro_deg_s, recording.accel / STANDARD_GRAVITY, strict=True)):
        if recording.mag is None:
            model.update_no_magnetometer(gyro, accel)
        else:
            model.update(gyro, accel, recording.mag[k])
        quaternion[k] = model.get_quaternion()
    return quaternion


def ahrs_package(recording, *, name, north_is_x):
    """A filter of the package ahrs, default settings, started with the attitude of the first sample.

    With z up, its Madgwick filter has magnetic north along x and its Mahony filter along y.
    """
    from ahrs import filters

    model = getattr(filters, name)(frequency=recording.sample_rate_hz)
    q = first_attitude(recording)
    if not north_is_x:
        q = multiply(conjugate(enu_to_nwu((1, 0, 0, 0))), q)
    quaternion = np.empty((len(recording.time_s), 4))
    for k, gyro in enumerate(np.radians(recording.gyro_deg_s)):
        sample = gyro, recording.accel[k]
        q = model.updateIMU(q, *sample) if recording.mag is None else model.updateMARG(q, *sample, recording.mag[k])
        quaternion[k] = q
    return quaternion if north_is_x else enu_to_nwu(quaternion)


FILTERS: dict[str, Callable] = {
    "thesis": partial(complementary, config=THESIS),
    "plain": partial(complementary, config=MAHONY),
    "flight": flight,
    "vqf": vqf,
    "imufusion": imufusion,
    "ahrs Madgwick": partial(ahrs_package, name="Madgwick", north_is_x=True),
    "ahrs Mahony": partial(ahrs_package, name="Mahony", north_is_x=False),
}
"""Maps each name to a function of a Recording that returns the attitude after each sample, sensor to NWU, (N, 4)."""

PACKAGES = ("ahrs", "imufusion", "vqf")
FIGURES = AttitudeErrors._fields


def _scored(recording, name):
    """RMS errors, degrees, of one filter on one recording."""
    match = match_reference(recording, FILTERS[name](recording))
    errors = attitude_errors(match.q_est, match.q_ref)
    return {figure: rms(getattr(errors, figure)) for figure in FIGURES}


def measure(*folders: str | os.PathLike, jobs: int = 2, scheduler: str | None = None,
            progress: Callable[[int, int], object] | None = None) -> dict[str, Any]:
    """Run every filter over every recording of some folders that has a reference orientation.

    Parameters
    ----------
    *folders : Path
        Folders of recordings, ``.npz``.
    jobs, scheduler
        See ``strapdown_sim.jobs.workers``.
    progress : callable or None
        ``progress(done, total)`` after each run.

    Returns
    -------
    dict
        Versions of the packages; names of the recordings without reference; and by recording its
        ``axes`` (6 or 9) and by filter the RMS ``total``, ``heading`` and ``inclination`` error in
        degrees. With 6 axes, a constant heading offset is not counted.

    Raises: RecordingError; ModuleNotFoundError without the packages; JobsError.
    """
    versions = {package: version(package) for package in PACKAGES}
    paths = [path for folder in folders for path in sorted(Path(folder).glob("*.npz"))]
    recordings = {path: read_recording(path) for path in paths}
    references = {path: recording.reference for path, recording in recordings.items()}
    scored = [path for path, reference in references.items() if reference is not None and reference.valid.any()]
    runs = {(path.stem, name): (recordings[path], name) for path in scored for name in FILTERS}
    rows: dict = {path.stem: {"axes": 6 if recordings[path].mag is None else 9, "filters": dict.fromkeys(FILTERS)}
                  for path in scored}
    with workers(jobs, scheduler) as pool:
        for done, ((stem, name), figures) in enumerate(completed(pool, _scored, runs.items()), start=1):
            rows[stem]["filters"][name] = outcome(figures)
            if progress:
                progress(done, len(runs))
    return {"packages": versions, "without_reference": [path.stem for path in paths if path not in scored],
            "recordings": rows}


def means(result, axes, tuned=None):
    """Mean of each figure over the recordings with ``axes`` axes, by filter: all, those of TUNED_ON, or the others."""
    rows = [row["filters"] for stem, row in result["recordings"].items()
            if row["axes"] == axes and tuned in (None, stem in TUNED_ON)]
    return {name: {figure: float(np.mean([row[name][figure] for row in rows])) for figure in FIGURES}
            for name in FILTERS} if rows else {}


def figure_table(result, figure):
    """One figure as a Markdown table: one row per recording, one column per filter, means below.

    Recordings of TUNED_ON come first, with a star.
    """
    rows = []
    for axes in (9, 6):
        for tuned, title in ((True, f"mean, {axes} axes, tuned on \\*"), (False, f"mean, {axes} axes, others")):
            rows += [_row(f"`{stem}`" + " \\*" * tuned, [row["filters"][name][figure] for name in FILTERS])
                     for stem, row in result["recordings"].items()
                     if row["axes"] == axes and tuned == (stem in TUNED_ON)]
            if mean := means(result, axes, tuned):
                rows.append(_row(f"**{title}**", [mean[name][figure] for name in FILTERS]))
    return markdown_table(["recording", *(f"{name}:" for name in FILTERS)], rows)


def _row(title, values):
    best = min(values)
    return [title, *(f"**{value:.2f}**" if value == best else f"{value:.2f}" for value in values)]


def write_accuracy(result: dict[str, Any], directory: str | os.PathLike) -> Path:
    """Write ``accuracy.json``, ``accuracy.md`` and ``accuracy.png``; returns the path of the second."""
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "accuracy.json").write_text(json.dumps(result, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    page = [
        "# Attitude error on real recordings", "",
        "RMS in degrees against the recordings' references, as defined by the BROAD data set.",
        f"thesis: Kp {THESIS.kp:g}, Ki {THESIS.ki:g}; plain: Kp {MAHONY.kp:g}, Ki {MAHONY.ki:g}. These two and those",
        "of ahrs start with the attitude of the first sample. Published filters have their default settings: "
        + ", ".join(f"{package} {number}" for package, number in result["packages"].items()) + ".",
        "With 6 axes, a constant heading offset is not counted. Parameters of flight were chosen on the recordings",
        "with a star."]
    if missing := result["without_reference"]:
        names = ", ".join(f"`{stem}`" for stem in missing)
        page += ["", f"Not scored, because they have no reference orientation: {names}."]
    for figure in FIGURES:
        page += ["", f"## {figure.capitalize()}", "", figure_table(result, figure)]
    path = directory / "accuracy.md"
    path.write_text("\n".join(page) + "\n", encoding="utf-8")
    _picture(result, directory / "accuracy.png")
    return path


def _picture(result, path):
    """Total and inclination error: one group per recording, one bar per filter, logarithmic."""
    stems = list(result["recordings"])
    figure = Figure(figsize=(9.0, 6.4), dpi=150, layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    width, places = 0.8 / len(FILTERS), np.arange(len(stems))
    for axes, name in zip(panels, ("total", "inclination"), strict=True):
        for k, (label, colour) in enumerate(zip(FILTERS, COLOURS, strict=True)):
            values = [result["recordings"][stem]["filters"][label][name] for stem in stems]
            axes.bar(places + (k - (len(FILTERS) - 1) / 2) * width, values, width, label=label, color=colour)
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_ylabel(f"{name} error, RMS (°)")
        axes.grid(axis="y", color="#e4e4e4", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    panels[1].set_xticks(places, [stem.replace("_", " ") for stem in stems], rotation=25, ha="right", fontsize="small")
    panels[0].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=len(FILTERS), frameon=False, fontsize="small")
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
