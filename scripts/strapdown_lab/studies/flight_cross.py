"""Cross-validation of the inclination: flight filter and VQF, tuned on half of the recordings, judged on the other.

The script writes docs/report/flight_cross.json and two tables in docs/flight.md. It takes some minutes. Both filters
are tuned in the same way, from their defaults, by the same number of runs. The parameters of the product are not
changed by it. The arguments are the folders of the recordings.
"""

import json
import sys
from importlib.metadata import version
from itertools import chain
from typing import ClassVar

import numpy as np

from strapdown.cores import FLIGHT, FLIGHT_6AXIS, ins_flight
from strapdown.kernel.native import NativeTwin
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.accuracy import vqf
from strapdown_lab.studies.flight_cases import cases_digest, referenced
from strapdown_lab.studies.flight_parts import POOL
from strapdown_sim.errors import attitude_errors, match_reference, rms

__all__ = ["Flight", "Vqf", "cross_tables", "halves", "judged", "main", "tuned"]

SETS = {"broad": "BROAD", "ins_quad": "quadrotors", "tumvi": "TUM-VI"}
"""Maps the first letters of a recording's name to the name of its data set."""

STEP = 1.5
"""Factor by which each parameter differs from its default in the first simplex of the search."""

RUNS = 300
"""Parameter sets that a search may try."""


def halves(recordings):
    """Two halves: of each data set, the recordings at even and at odd places in the order of their names."""
    sets = [sorted((each for each in recordings if each.name.startswith(letters)), key=lambda each: each.name)
            for letters in SETS]
    return tuple(list(chain.from_iterable(each[place::2] for each in sets)) for place in range(2))


class Flight:
    """The core's twin, whose parameters are inputs."""

    name = "flight"
    defaults: ClassVar = {field: getattr(FLIGHT, field) for field in (
        "acceleration_time", "rest_rate", "rest_acceleration", "rest_time", "bias_deviation", "bias_drift",
        "bias_noise", "bias_learning", "bias_rest_deviation")}

    def __init__(self):
        self._twins = {}

    def attitude(self, recording, parameters):
        """Attitude after each sample, sensor to NWU."""
        kind = recording.mag is not None, recording.sample_rate_hz
        if kind not in self._twins:
            config = FLIGHT if recording.mag is not None else FLIGHT_6AXIS
            system = ins_flight(config.replace(sample_rate_hz=recording.sample_rate_hz, inputs=tuple(self.defaults)))
            self._twins[kind] = system, NativeTwin(system, POOL)
        system, twin = self._twins[kind]
        given = {"a": recording.accel, "m": recording.mag, "g": recording.gyro_deg_s} | parameters
        # The reset state has the default of this parameter.
        state = {"bias_variance": parameters["bias_deviation"]**2}
        result, _ = twin.run(system.bind(**{name: given[name] for name in system.inputs}), state)
        return system.read(result)["q"].astype(float)


class Vqf:
    """VQF, with the corresponding parameters."""

    name = "vqf"
    defaults: ClassVar = {
        "tauAcc": 3.0, "restThGyr": 2.0, "restThAcc": 0.5, "restMinT": 1.5, "biasSigmaInit": 0.5,
        "biasForgettingTime": 100.0, "biasSigmaMotion": 0.1, "biasVerticalForgettingFactor": 0.0001,
        "biasSigmaRest": 0.03}

    def attitude(self, recording, parameters):
        """Attitude after each sample, sensor to NWU."""
        return vqf(recording, **parameters)


def inclination(model, recording, parameters):
    """RMS inclination error in degrees."""
    match = match_reference(recording, model.attitude(recording, parameters))
    return rms(attitude_errors(match.q_est, match.q_ref).inclination)


def geometric_mean(values):
    """The mean in which each recording counts by its relative error."""
    return float(np.exp(np.mean(np.log(list(values)))))


def tuned(model, recordings, runs=RUNS):
    """Parameters with the least geometric mean of the inclination errors, by the simplex of Nelder and Mead."""
    from scipy.optimize import minimize

    names, start = list(model.defaults), np.log(list(model.defaults.values()))

    def parameters(logarithms):
        return dict(zip(names, np.exp(logarithms).tolist(), strict=True))

    def cost(logarithms):
        return np.log(geometric_mean(inclination(model, each, parameters(logarithms)) for each in recordings))

    simplex = np.vstack([start, start + np.log(STEP) * np.eye(len(start))])
    found = minimize(cost, start, method="Nelder-Mead",
                     options={"initial_simplex": simplex, "maxfev": runs, "adaptive": True})
    return parameters(found.x)


def judged(models, parts, runs=RUNS, progress=print):
    """Parameters tuned on each half, and the errors of each recording: default, tuned on the other half, on its own."""
    figures: dict = {"tuned": [{}, {}], "recordings": [{each.name: {} for each in part} for part in parts]}
    for model in models:
        found = [tuned(model, part, runs) for part in parts]
        for place, part in enumerate(parts):
            figures["tuned"][place][model.name] = found[place]
            variants = {"default": model.defaults, "other": found[1 - place], "own": found[place]}
            for recording in part:
                errors = {name: inclination(model, recording, values) for name, values in variants.items()}
                figures["recordings"][place][recording.name][model.name] = errors
            progress(model.name, place + 1, {
                name: geometric_mean(row[model.name][name] for row in figures["recordings"][place].values())
                for name in variants})
    return figures


COLUMNS = (("flight", "default"), ("vqf", "default"), ("flight", "other"), ("vqf", "other"))


def _cells(rows, mean):
    flight, reference, flight_tuned, reference_tuned = (
        mean([row[model][variant] for row in rows]) for model, variant in COLUMNS)
    return [f"{value:.3f}" for value in (
        flight, reference, flight / reference, flight_tuned, reference_tuned, flight_tuned / reference_tuned)]


def cross_tables(result):
    """The figures as Markdown tables, by the name of their block."""
    rows = []
    for place, half in enumerate(result["recordings"], start=1):
        rows += [[f"half {place}: `{name}`", *_cells([row], np.mean)] for name, row in half.items()]
        rows.append([f"**half {place}, geometric mean**", *_cells(half.values(), geometric_mean)])
    whole = {name: row for half in result["recordings"] for name, row in half.items()}
    for letters, title in SETS.items():
        rows.append([f"**{title}, geometric mean**", *_cells(
            [row for name, row in whole.items() if name.startswith(letters)], geometric_mean)])
    rows.append(["**all, geometric mean**", *_cells(whole.values(), geometric_mean)])
    parameters = [[f"{model.name}: `{name}`", f"{value:.3g}", *(
        f"{half[model.name][name]:.3g}" for half in result["tuned"])]
        for model in (Flight, Vqf) for name, value in model.defaults.items()]
    return {"cross-validation": markdown_table(
                ["", "flight:", "vqf:", "ratio:", "flight, tuned:", "vqf, tuned:", "ratio:"], rows),
            "cross-validated parameters": markdown_table(
                ["parameter", "default:", "tuned on half 1:", "tuned on half 2:"], parameters)}


def main():
    """Tune, judge, and write the JSON file and the tables."""
    result = {"equations_sha256": cases_digest(), "vqf": version("vqf"), "runs": RUNS,
              **judged((Flight(), Vqf()), halves(referenced(sys.argv[1:])))}
    (ROOT / "docs" / "report" / "flight_cross.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "flight.md", cross_tables(result))


if __name__ == "__main__":
    main()
