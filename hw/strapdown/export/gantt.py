"""A schedule as a picture, unit against cycle, and its critical path in words."""

from pathlib import Path

from strapdown.kernel.machine import BUSES

from .explain import kernel_line

__all__ = ["schedule_summary", "schedule_picture"]


def schedule_summary(schedule, latency):
    """Lines: length and its bounds, utilisation of the units, critical path with its kernel lines.

    If several updates are in flight, the interval between them is compared with its bounds.

    Parameters
    ----------
    schedule : Schedule
    latency : int
        Cycles from start to finish of the engine, which are more than those of its microprogram.
    """
    yield f"{latency} cycles from start to finish; below, those of the microprogram are counted"
    bound = max(schedule.bounds, key=schedule.bounds.get)
    if schedule.interval:
        yield f"an update takes {schedule.length} cycles, and up to {schedule.stages} are in flight; one begins every"
    yield f"{schedule.period} cycles, {schedule.period - schedule.bounds[bound]} above the bound:"
    for name, cycles in sorted(schedule.bounds.items(), key=lambda item: -item[1]):
        yield f"  {cycles:4}  {name}"
    yield "busy:"
    for name, share in sorted(schedule.utilisation().items(), key=lambda item: -item[1]):
        yield f"  {share:4.0%}  {name}"
    yield "critical path (cycles, unit, operation, cycles it waited for a unit, port or the bus):"
    for step, wait in schedule.critical_path:
        waited, origin = f"+{wait}" if wait else "", kernel_line(step.node) if step.node.origin else step.node.label
        yield f"  {step.issue:4} to {step.write:4}  {step.unit:<12} {step.node.operation:<9} {waited:>4}  {origin}"


def schedule_picture(schedule, latency, title, path):
    """Draw a schedule of one update: one row per unit, one bar per operation, coloured by section.

    Full colour means that the unit can take no other operation, pale colour that the operation is in the pipeline. A
    line marks the critical path. If several updates are in flight, dotted lines mark the starts of further updates.
    The suffix of ``path`` selects the format; ``latency`` is as in ``schedule_summary``.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    units = [unit for unit in schedule.pool.units if any(step.unit == unit.name for step in schedule.steps)]
    buses = [name for bus, name in BUSES.items()
             if any(schedule.on_bus(step) and step.bus == bus for step in schedule.steps)]
    rows = {name: row for row, name in enumerate(["input", "constant", *(unit.name for unit in units), *buses])}
    intervals = {unit.name: unit.interval for unit in units} | {"input": 1, "constant": 1}
    colours = {section: f"C{index}" for index, section in enumerate(schedule.graph.sections)}

    figure = Figure(figsize=(14, 0.45 * len(rows) + 1.6), layout="constrained")
    axes = figure.subplots()
    for step in schedule.steps:
        row, colour = rows[step.unit], colours[step.node.section] if step.node.computed else "0.55"
        bars = [(row, step.issue, max(step.write - step.issue, 1), 0.25), (row, step.issue, intervals[step.unit], 1)]
        if schedule.on_bus(step):
            bars.append((rows[BUSES[step.bus]], step.write, 1, 1))
        for place, left, width, alpha in bars:
            axes.barh(place, width, left=left, height=0.8, color=colour, alpha=alpha, linewidth=0)
    critical = [(step.issue + 0.5, rows[step.unit]) for step, _ in schedule.critical_path]
    axes.plot(*zip(*critical, strict=True), color="black", linewidth=0.8, marker="o", markersize=2.5)
    axes.set_yticks(list(rows.values()), list(rows))
    axes.invert_yaxis()
    axes.set_xlim(0, schedule.length)
    axes.set_xlabel("cycle of the microprogram")
    for begin in range(schedule.period, schedule.length, schedule.period):
        axes.axvline(begin, color="black", linewidth=0.6, linestyle=":")
    interval = f", one update every {schedule.interval}" if schedule.interval else ""
    axes.set_title(f"{title}: {latency} cycles from start to finish, {schedule.length} of them in the microprogram"
                   f"{interval}", loc="left")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(handles=[*(Patch(color=colour, label=section) for section, colour in colours.items()),
                         Patch(color="0.55", label="inputs, constants, reset values")],
                ncols=len(colours) + 1, loc="lower right", bbox_to_anchor=(1, 1), frameon=False, fontsize="small")
    path = Path(path)
    figure.savefig(path, dpi=150, metadata={"Software": None} if path.suffix == ".png" else None)
