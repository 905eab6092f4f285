"""Calibration of the optical attitude sensor: what differs from unit to unit."""

from dataclasses import asdict, dataclass
from typing import Any

__all__ = ["SET_A", "SET_B", "Calibration"]


@dataclass(frozen=True)
class Calibration:
    """Constants of one unit; ``_r`` and ``_p`` are the roll and the pitch CCD.

    Attributes
    ----------
    n0_r, n0_p : float
        Position of the line at zero angle, pixels, 0-based.
    scale_r, scale_p : float
        Pixel pitch over distance from the pivot; negative if pixels count against the angle.
    tilt_r, tilt_p : float
        Slope of the CCD against the plane across the rotor axis.
    c3_r, c3_p : float
        Cubic distortion by a cover glass: w·(1 + c3·w²) for the slope w = (p − n0)·scale.
    h : float
        Sideways place of the pitch CCD over distance from the pivot.
    k : float
        Precession coefficient m·l_oc/H, s/m; positive for a centre of mass towards the lasers and a spin vector
        that points to them.
    """

    n0_r: float
    n0_p: float
    scale_r: float
    scale_p: float
    tilt_r: float = 0.0
    tilt_p: float = 0.0
    c3_r: float = 0.0
    c3_p: float = 0.0
    h: float = 0.0
    k: float = 0.0

    def ports(self) -> dict[str, Any]:
        """Values of the input ports of OPT_attitude and OPT_top, by port name."""
        return {f"in_{name}": value for name, value in asdict(self).items()}


SET_A = Calibration(n0_r=1823.5, n0_p=1823.5, scale_r=3.2e-4, scale_p=3.2e-4, k=8e-4)
"""An ideal unit with CCDs of 8 µm pitch at 25 mm."""

SET_B = Calibration(n0_r=1823.5, n0_p=1830.25, scale_r=3.2e-4, scale_p=8 / 25_500, tilt_r=0.02, tilt_p=-0.01, h=0.24,
                    k=8e-4)
"""A unit with CCDs out of place."""
