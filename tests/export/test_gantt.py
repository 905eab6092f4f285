from strapdown.cores import THESIS, THESIS_X8, make_core
from strapdown.export.gantt import schedule_picture, schedule_summary


def schedule_of(name):
    return make_core(name, THESIS).engine.program.schedule


def test_summary_tells_length_bounds_and_critical_path():
    core = make_core("INS_quat", THESIS)
    schedule = core.engine.program.schedule
    told, *lines = schedule_summary(schedule, core.latency)
    # The figure of tables and headers stands beside that of the schedule.
    assert told == f"{core.latency} cycles from start to finish; below, those of the microprogram are counted"
    assert core.latency > schedule.length
    assert lines[0].startswith(f"{schedule.length} cycles, ")
    assert any(line.split()[-1:] == ["dependences"] for line in lines)
    assert any("attitude.py" in line and "quaternion" in line for line in lines)


def test_picture_is_written_and_the_same_every_time(tmp_path):
    schedule = schedule_of("INS_atan")
    for name in ("first.png", "second.png"):
        schedule_picture(schedule, 41, "INS_atan", tmp_path / name)
    first, second = ((tmp_path / name).read_bytes() for name in ("first.png", "second.png"))
    assert first[:4] == b"\x89PNG"
    assert first == second


def test_several_updates_in_flight_are_summed_up_and_drawn(tmp_path):
    schedule = make_core("INS_top_x8", THESIS_X8).engine.program.schedule
    _, *lines = schedule_summary(schedule, schedule.length + 1)
    assert lines[0] == f"an update takes {schedule.length} cycles, and up to {schedule.stages} are in flight; " \
        "one begins every"
    assert lines[1].startswith(f"{THESIS_X8.interval} cycles, ")
    assert any("3 buses" in line for line in lines)
    assert all(float(line.split("%")[0]) <= 100 for line in lines if "%" in line)
    schedule_picture(schedule, schedule.length + 1, "INS_top_x8", tmp_path / "picture.svg")
    drawn = (tmp_path / "picture.svg").read_text(encoding="utf-8")
    # A line at the start of each further update: matplotlib draws dotted lines with dashes.
    assert drawn.count("stroke-dasharray") == (schedule.length - 1) // schedule.interval
