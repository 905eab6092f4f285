"""The position error of SINS_top after an hour of flight with sensors free of errors.

The script writes docs/report/airliner.json and the table in docs/sins.md. It takes some minutes.
"""

import json

import numpy as np

from strapdown.cores import SINS, SINS_DAMPED, sins_top
from strapdown.kernel.native import NativeTwin
from strapdown.kernel.operators import Adder, Divider, Multiplier, Selector
from strapdown.kernel.pool import Pool
from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.equations import equations_digest
from strapdown_sim.errors import quaternion_from_matrix
from strapdown_sim.reference.sins import Navigator, platform_from_geodetic
from strapdown_sim.stimuli.flight import Flight, airliner

__all__ = ["POOL", "airliner_digest", "airliner_table", "measured"]

POOL = Pool(format=SINS.pool.format, operators=(Adder(), Multiplier(), Divider(), Selector()))
"""The compiled twin has no arctangent. Position and attitude are states, and do not depend on it."""


def airliner_digest():
    """Digest of the equations of both configurations."""
    return equations_digest(sins_top(SINS), POOL) + equations_digest(sins_top(SINS_DAMPED), POOL)


def last_position(config, flight, samples, truth):
    """C_e^p and height after the twin's last update, and its number of updates."""
    system = sins_top(config)
    omega, force, altitude = (np.concatenate([values[:1], values]) for values in (*samples, truth.height_m))
    load = np.zeros(len(omega))
    load[0] = 1.0
    values = {"omega": omega, "f": force, "load": load, "align": 0.0, "altitude": altitude, "start_v": np.zeros(3),
              "place": (flight.latitude_deg, flight.longitude_deg), "start_h": flight.height_m,
              "start_q": quaternion_from_matrix(start_attitude(flight).T)}
    result, _ = NativeTwin(system, POOL).run(system.bind(**{name: values[name] for name in system.inputs}))
    state = system.read(result, system.state)
    return state["c"][-1], state["h"][-1], len(omega)


def start_attitude(flight):
    """C_b^n of the vehicle at rest at the start."""
    return Flight(1, latitude_deg=flight.latitude_deg, track_deg=flight.track_deg).sample(1)[2].c_b2n[0]


def error(flight, position, latitude, longitude, height_m):
    """East, north and up from a true position to that of (C_e^p, height), m."""
    c, height = position
    meridian, prime = flight.earth.radii(latitude)
    found_latitude = np.arctan2(c[2, 2], np.hypot(c[2, 0], c[2, 1]))
    turn = np.arctan2(c[2, 1], c[2, 0]) - longitude
    return [float(value) for value in (
        (np.mod(turn + np.pi, 2 * np.pi) - np.pi) * (prime + height_m) * np.cos(latitude),
        (found_latitude - latitude) * (meridian + height_m), height - height_m)]


def measured(flight, period_s):
    """Number of updates, distance in m, and the error of each row of the table, m."""
    *samples, truth = flight.sample(period_s)
    end = truth.latitude[-1], truth.longitude[-1], truth.height_m[-1]
    (*damped, count), (*free, _) = (last_position(config.replace(sample_rate_hz=1 / period_s), flight, samples, truth)
                                    for config in (SINS_DAMPED, SINS))
    navigator = Navigator(
        flight.earth, period_s, start_attitude(flight),
        platform_from_geodetic(np.radians(flight.latitude_deg), np.radians(flight.longitude_deg)), np.zeros(3),
        np.array(flight.height_m))
    for omega_b, f_b in zip(*samples, strict=True):
        navigator.step(omega_b, f_b)
    told = navigator.navigation()
    return {"updates": count, "distance_m": float(flight.distance()), "errors_m": {
        "damped, twin against the truth": error(flight, damped, *end),
        "free, twin against the truth": error(flight, free, *end),
        "free, twin against the reference navigator": error(
            flight, free, told.latitude, told.longitude, told.height_m)}}


def airliner_table(result):
    """The errors as a Markdown table."""
    def metres(value):
        return f"{value:.2f} m" if abs(value) >= 0.1 else f"{value:.4f} m"

    return markdown_table([f"after {result['updates']:,} updates and {result['distance_m'] / 1000:.0f} km", "east:",
                           "north:", "up:"],
                          [[name, *map(metres, values)] for name, values in result["errors_m"].items()])


def main():
    """Measure, and write the JSON file and the table."""
    result = {"equations_sha256": airliner_digest(), **measured(airliner(), 1 / SINS.sample_rate_hz)}
    (ROOT / "docs" / "report" / "airliner.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    write_blocks(ROOT / "docs" / "sins.md", {"airliner": airliner_table(result)})


if __name__ == "__main__":
    main()
