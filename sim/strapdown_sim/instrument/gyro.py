"""The rotor of a vertical gyro whose centre of mass is off the pivot, as a rigid body with nutation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .errors import InstrumentError
from .flights import Flight

__all__ = ["Gyro"]

TABLE_S = 0.005
"""Step of the table of forces that the integration interpolates with cubic splines."""


@dataclass(frozen=True)
class Gyro:
    """A symmetric rotor on a pivot, free of friction.

    Attributes
    ----------
    mass_kg, arm_m : float
        Mass; distance of the centre of mass from the pivot, positive towards the lasers.
    spin_kg_m2_s : float
        Angular momentum about the axis; positive if it points to the lasers.
    inertia_kg_m2 : float
        Moment of inertia across the axis.
    drift_rad_s : float
        Drift by bearing torques about the two horizontal axes of inertial space.
    """

    mass_kg: float = 0.4
    arm_m: float = 1e-4
    spin_kg_m2_s: float = 0.05
    inertia_kg_m2: float = 2e-4
    drift_rad_s: float = 0.0

    @property
    def k(self):
        """Precession coefficient m·l_oc/H, s/m."""
        return self.mass_kg * self.arm_m / self.spin_kg_m2_s

    @property
    def nutation_hz(self):
        """Frequency of nutation."""
        return abs(self.spin_kg_m2_s) / self.inertia_kg_m2 / (2 * np.pi)

    def axis(self, flight: Flight, time_s: ArrayLike, start: ArrayLike = (0.0, 0.0, 1.0)) -> np.ndarray:
        """Rotor axis in the level frame at rising times from 0 on, s: shape (N, 3).

        Euler's law about the pivot, which accelerates with a: L̇ = r × m(g − a), with r = l·n and
        L = H·n + I·n × ṅ. In space, by an eighth-order Runge-Kutta method (DOP853), from a start without nutation.
        Raises: InstrumentError without scipy.
        """
        try:
            from scipy.integrate import solve_ivp
            from scipy.interpolate import CubicSpline
        except ImportError:
            raise InstrumentError("the gyro needs the package scipy: pip install 'strapdown[optical]'") from None
        times = np.asarray(time_s, float)
        grid = np.arange(0, times[-1] + 2 * TABLE_S, TABLE_S)
        motion = flight.at(grid)
        force = CubicSpline(grid, _turned(motion.f_l, motion.heading))
        moment, inertia, drift = self.mass_kg * self.arm_m, self.inertia_kg_m2, self.drift_rad_s * self.spin_kg_m2_s

        def rate(t, state):
            n0, n1, n2, l0, l1, l2 = state.tolist()
            # f = a − g.
            fx, fy, fz = force(t).tolist()
            return ((l1 * n2 - l2 * n1) / inertia, (l2 * n0 - l0 * n2) / inertia, (l0 * n1 - l1 * n0) / inertia,
                    drift - moment * (n1 * fz - n2 * fy), drift - moment * (n2 * fx - n0 * fz),
                    -moment * (n0 * fy - n1 * fx))

        axis = _turned(np.divide(start, np.linalg.norm(start)), motion.heading[0])
        precession = -self.k * np.cross(axis, force(0.0))
        momentum = self.spin_kg_m2_s * axis + self.inertia_kg_m2 * np.cross(axis, precession)
        solution = solve_ivp(rate, (0.0, times[-1]), [*axis, *momentum], "DOP853", t_eval=times,
                             rtol=1e-8, atol=1e-10)
        return _turned(solution.y[:3].T, -flight.at(times).heading)


def _turned(v, angle):
    """Vectors, turned about the vertical."""
    x, y, z = np.moveaxis(np.asarray(v, float), -1, 0)
    return np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y, z], axis=-1)
