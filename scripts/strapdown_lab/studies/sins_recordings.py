"""Run the recordings that have a position through SINS_top's twin and the float64 reference, without any aid.

It writes the table into docs/sins.md, and takes some minutes. The argument is the folder of the recordings.
"""

import sys
from pathlib import Path

import numpy as np

from strapdown.markdown import markdown_table
from strapdown_lab.checkout import ROOT, write_blocks
from strapdown_lab.studies.inertial import car_leg, quadrotor_legs, run_reference, run_twin, track_errors

SECONDS = (1, 2, 5, 10, 30)
CAR, QUADROTORS = "ins_drive_first_half", {"ins_quad_horizontal_11": 50, "ins_quad_vertical_17": 42}
HEAD = ["recording", "legs:", "duration:", *(f"{second} s:" for second in SECONDS), "at the end:",
        "twin − reference, m:"]


def legs(folder):
    """Each recording with its legs: one of the car, many short ones of the quadrotor, and one of most of its flight."""
    yield CAR, car_leg(folder / f"{CAR}.npz", 60)
    for name, flight_s in QUADROTORS.items():
        for duration_s in (5, flight_s):
            yield name, quadrotor_legs(folder / f"{name}.npz", duration_s)


def rows(folder):
    """Rows of the table."""
    for name, leg in legs(folder):
        run, reference = run_twin(leg), run_reference(leg)
        errors = np.median(track_errors(leg, run), axis=1)
        cells = [f"{horizontal:.2f} / {vertical:.2f}" if second <= leg.sample[-1] * leg.period_s + 0.5 else "–"
                 for second in SECONDS
                 for horizontal, vertical in [errors[np.abs(leg.sample * leg.period_s - second).argmin()]]]
        difference = np.linalg.norm(run.position_m - reference.position_m, axis=-1).max()
        end = " / ".join(f"{error:,.0f}" if error >= 100 else f"{error:.2g}" for error in errors[-1])
        duration = f"{len(leg.omega_b) * leg.period_s:.0f} s"
        yield [f"`{name}`", len(leg.q_b2n), duration, *cells, end, f"{difference:.1g}"]


def main():
    """Print the table, and put it into docs/sins.md."""
    table = []
    for row in rows(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT.parent / "shared" / "recordings"):
        print(*row, flush=True)
        table.append(row)
    write_blocks(ROOT / "docs" / "sins.md", {"recordings": markdown_table(HEAD, table)})


if __name__ == "__main__":
    main()
