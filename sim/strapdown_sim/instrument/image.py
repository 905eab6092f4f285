"""Images of a laser line on a line CCD, with the errors of light, die and read-out."""

from dataclasses import dataclass, field

import numpy as np

__all__ = ["FULL_SCALE", "LineCamera"]

FULL_SCALE = 4095
"""Largest count."""


@dataclass
class LineCamera:
    """One CCD: its fixed errors, and its random errors as lines are read.

    Attributes
    ----------
    pixels : int
        Effective pixels.
    sigma_px, peak : float
        Width of the Gaussian line; its peak at ``exposure_s``, as a fraction of full scale.
    exposure_s : float
        Exposure that gives ``peak``.
    offset : float
        Counts without light.
    shot_electrons : float
        Electrons at full scale, for shot noise; 0: none.
    read_counts : float
        Read noise, rms.
    prnu : float
        Spread of the pixels' sensitivities, rms, fixed.
    fringes, fringe_px : float
        Speckle and fringes: white noise smoothed by a Gaussian of ``fringe_px``, of this rms, fixed on the die.
    lag : float
        Part of a line that is left for the next.
    transfer : float
        Part of the charge of the last pixel that arrives in its own slot; the rest comes one slot later. The loss
        grows linearly along the register.
    ambient, gradient : float
        Background at ``exposure_s``, fractions of full scale: at the first pixel, and what is added up to the last.
    ghost, ghost_px : float
        A second line: its peak as a fraction of the first, its distance.
    smear : float
        Light into the register, as a fraction of the line's sum that a pixel collects on its way past the line.
    laser : bool
        False: only background.
    seed : int
        Of all noise. Equal seeds and calls give equal counts.
    """

    pixels: int
    sigma_px: float = 8.0
    peak: float = 0.7
    exposure_s: float = 1e-4
    offset: float = 100.0
    shot_electrons: float = 50_000.0
    read_counts: float = 4.0
    prnu: float = 0.0
    fringes: float = 0.0
    fringe_px: float = 6.0
    lag: float = 0.0
    transfer: float = 1.0
    ambient: float = 0.0
    gradient: float = 0.0
    ghost: float = 0.0
    ghost_px: float = 0.0
    smear: float = 0.0
    laser: bool = True
    seed: int = 0
    _rng: np.random.Generator = field(init=False, repr=False)
    _sensitivity: np.ndarray = field(init=False, repr=False)
    _left: np.ndarray = field(init=False, repr=False)

    def __post_init__(self):
        self._rng = np.random.default_rng(self.seed)
        grain = self._rng.standard_normal(self.pixels)
        speckle = _smoothed(self._rng.standard_normal(self.pixels), self.fringe_px)
        self._sensitivity = (1 + self.prnu * grain) * (1 + self.fringes * speckle / speckle.std())
        self._left = np.zeros(self.pixels)

    def light(self, position_px, exposure_s=None):
        """Charge of the pixels without errors, as fractions of full scale, not clipped; shape (..., pixels)."""
        position = np.asarray(position_px, float)[..., None]
        exposure = np.asarray(self.exposure_s if exposure_s is None else exposure_s, float)[..., None]
        distance = np.arange(self.pixels) - position
        light = self.ambient + self.gradient * np.arange(self.pixels) / (self.pixels - 1)
        lines = self._line(distance) + self.ghost * self._line(distance - self.ghost_px)
        return (light + self.laser * self.peak * lines) * exposure / self.exposure_s

    def _line(self, distance):
        return np.exp(-(distance / self.sigma_px) ** 2 / 2)

    def charge(self, position_px, exposure_s=None):
        """Counts of lines read one after the other, light positive.

        Parameters
        ----------
        position_px : array_like, shape () or (N,)
            Place of the line, 0-based pixels.
        exposure_s : array_like, optional
            Exposure of all lines or of each; ``self.exposure_s`` by default.

        Returns
        -------
        ndarray of uint16, shape (pixels,) or (N, pixels)
            12-bit counts.
        """
        lines = self.light(position_px, exposure_s)
        light = np.atleast_2d(lines) * self._sensitivity
        if self.smear:
            light += self.smear * np.cumsum(light, axis=-1)
        if self.lag:
            for row in light:
                row += self._left
                self._left = self.lag * np.minimum(row, 1.0)
        light = np.minimum(light, 1.0)
        if self.shot_electrons:
            light = self._rng.poisson(light * self.shot_electrons) / self.shot_electrons
        if self.transfer < 1:
            late = light * np.linspace(0, 1 - self.transfer, self.pixels)
            light = light - late
            light[:, 1:] += late[:, :-1]
        counts = self.offset + FULL_SCALE * light + self.read_counts * self._rng.standard_normal(light.shape)
        return np.clip(np.rint(counts), 0, FULL_SCALE).astype(np.uint16).reshape(lines.shape)


def _smoothed(noise, sigma_px):
    """Noise, smoothed by a Gaussian, on a circle."""
    frequency = np.fft.rfftfreq(len(noise))
    return np.fft.irfft(np.fft.rfft(noise) * np.exp(-2 * (np.pi * sigma_px * frequency) ** 2), len(noise))
