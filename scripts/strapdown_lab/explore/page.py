"""The result of a search as a Markdown page and a picture."""

from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

from strapdown.markdown import markdown_table
from strapdown_lab.report.drawing import INK, OURS, finish, labelled_figure, place_labels, save

from .front import expected, measured, staircase

__all__ = ["explore_picture", "explore_table", "page", "pool_words"]

_PICK, _REST = "#cc3311", "#9aa4b2"


def pool_words(settings):
    """The settings of a pool in a cell."""
    return ", ".join(f"{name} {value}" for name, value in settings.items()) or "as it is"


def _complete(result):
    stage = "ecp5" if "ecp5" in result else "xc7"
    return [row for row in result["pools"] if stage in row]


def explore_table(result):
    """Table of the pools that the tools got, the fastest first, with their numbers in the picture; below, those that a
    tool failed on."""
    cells = []
    for row in result["pools"]:
        changes = pool_words(row["settings"])
        if "failed" in row:
            cells.append([row["number"], _names(row), row["cycles"], *"––––––", "failed",
                          f"{changes}: {row['failed']}"])
        elif "xc7" in row:
            own, bound = measured(row), row["estimate"]["mhz"]
            clock, time = (f"{own['mhz']:.0f}", f"{own['us']:.2f}") if "ecp5" in row else (
                f"≤ {bound:.0f}", f"≥ {expected(row)['us']:.2f}") if bound else "––"
            cells.append([row["number"], _names(row), row["cycles"], clock, time, f"{own['lut']:,}", f"{own['ff']:,}",
                          own["dsp"], f"{own['bram']:g}", "picked" if row["picked"] else "yes" if row["front"] else "",
                          changes])
    return markdown_table(["no.:", "configuration", "cycles:", "MHz, ECP5:", "µs:", "LUT:", "FF:", "DSP:", "BRAM:",
                           "front", f"changes of `{result['config']}`"], cells)


def _names(row):
    return ", ".join(f"`{name}`" for name in row["names"])


def page(result):
    """The Markdown page."""
    lines = [f"# Pools for `{result['module']}`, configuration `{result['config']}`",
             "![LUTs of the pools against the time of an update](explore.png)"]
    if pick := result["pick"]:
        lines += [f"Picked: no. {pick['number']}, {result['rule']}.", f"```sh\n{pick['command']}\n```"]
    else:
        lines.append(f"No pool has {result['wish']}.")
    lines += [explore_table(result), "\n".join(f"- {line}" for line in result["notes"])]
    return "\n\n".join(lines) + "\n"


def explore_picture(path, result):
    """LUTs against the time of an update, both axes logarithmic; equal figures give equal bytes.

    Filled points were measured by all tools, and the line joins those that none beats in time and LUTs. Open points are
    estimates, or lack the clock frequency.
    """
    done = _complete(result)
    placed = "ecp5" in result
    figure = labelled_figure(9.0, 6.0)
    axes = figure.subplots()
    rest = [row for row in result["pools"] if "failed" not in row and not any(row is other for other in done)]
    axes.scatter([expected(row)["time"] for row in rest], [expected(row)["lut"] for row in rest], s=14, zorder=2,
                 facecolor="none", edgecolor=_REST, linewidth=0.8)
    best = staircase(done, measured)
    axes.plot([measured(row)["time"] for row in best], [measured(row)["lut"] for row in best], color=OURS,
              linewidth=1.4, zorder=3)
    labels = []
    for row in sorted(done, key=lambda row: (not row["picked"], not row["names"], not row["front"])):
        own = measured(row)
        point = own["time"], own["lut"]
        colour = _PICK if row["picked"] else OURS if row["front"] else _REST
        axes.scatter(*point, s=170 if row["names"] else 48, marker="*" if row["names"] else "o", color=colour, zorder=4)
        if row["picked"] or row["names"] or row["front"]:
            names = [", ".join(row["names"])] if row["names"] else []
            if row["picked"]:
                names.append(f"picked: {own['us']:.2f} µs, {own['lut']:,} LUT, {own['dsp']} DSP" if placed else
                             f"picked: {own['cycles']} cycles, {own['lut']:,} LUT, {own['dsp']} DSP")
            text = f"{row['number']}  {'; '.join(names)}".strip()
            labels.append((point, text, {"color": colour if row["picked"] or row["names"] else INK,
                                         **({"fontweight": "bold"} if names else {})}))
    axes.set(xscale="log", yscale="log", ylabel="LUTs (7 series, by Yosys)",
             xlabel="one update (µs), at the clock frequency on an ECP5-6" if placed else "one update (cycles)")
    drawn = [measured(row) for row in done] + [expected(row) for row in rest]
    for axis, name in (axes.xaxis, "time"), (axes.yaxis, "lut"):
        values = [figures[name] for figures in drawn]
        low, high = min(values) / 1.15, max(values) * 1.25
        axis.set_major_locator(FixedLocator(_ticks(low, high)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
        axis.set_minor_formatter(NullFormatter())
        (axes.set_xlim if axis is axes.xaxis else axes.set_ylim)(low, high)
    axes.set_title(f"Pools for {result['module']}: area against time", loc="left", fontweight="bold", pad=24)
    what = "synthesised, placed and routed" if placed else "synthesised"
    axes.text(0, 1.02, f"filled: {what}, stars: configurations;  line: best in time and LUTs;  open: estimated",
              transform=axes.transAxes, fontsize=8.5, color=INK)
    finish(axes)
    figure.draw_without_rendering()  # The axes do not change after this.
    place_labels(axes, labels, [], fontsize=8)
    save(figure, path)


def _ticks(low, high):
    """Round numbers of a logarithmic axis."""
    steps = (1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 8)
    found = [step * 10.0 ** power for power in range(-4, 8) for step in steps if low <= step * 10.0 ** power <= high]
    return found if len(found) <= 12 else [value for value in found if f"{value:e}"[0] in "1235" and
                                           f"{value:e}"[2:4] == "00"]
