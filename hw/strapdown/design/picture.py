"""Picture of the coefficients' errors over the rate. Equal data give a PNG file of equal bytes."""

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

__all__ = ["error_picture"]


def error_picture(path, designs, *, period_s, highlighted):
    """Draw angle and norm error of one update over the rate.

    Parameters
    ----------
    path : path-like
        PNG file to write.
    designs : sequence of TransitionCoefficients
        All for the same largest angle.
    period_s : float
        Update period, seconds.
    highlighted : TransitionCoefficients
        The element of ``designs`` that is drawn with a thick line.
    """
    figure = Figure(figsize=(9.0, 5.4), dpi=150, layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    angles = np.linspace(0, highlighted.largest_angle, 129)[1:]
    rates = np.degrees(angles) / period_s
    for design in designs:
        bold = design is highlighted
        for axes, error in zip(panels, design.errors(angles), strict=True):
            axes.semilogy(rates, np.abs(error), linestyle="-" if design.method == "minimax" else "--",
                          linewidth=1.8 if bold else 0.8, color="#10243e" if bold else "#8fa8c0",
                          label=f"{design.method}, j = {design.order}")
    for axes, title in zip(panels, ("angle error of one update (rad)", "norm error of one update"), strict=True):
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("rate (deg/s)")
        axes.grid(color="#e4e4e4")
    panels[1].legend(fontsize=8)
    FigureCanvasAgg(figure).print_png(path, metadata={"Software": None})
