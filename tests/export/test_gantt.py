from strapdown.cores import THESIS, make_core
from strapdown.export.gantt import schedule_picture, schedule_summary


def schedule_of(name):
    return make_core(name, THESIS).engine.program.schedule


def test_summary_tells_length_bounds_and_critical_path():
    schedule = schedule_of("INS_quat")
    lines = list(schedule_summary(schedule))
    assert lines[0].startswith(f"{schedule.length} cycles, ")
    assert any(line.split()[-1:] == ["dependences"] for line in lines)
    assert any("attitude.py" in line and "quaternion" in line for line in lines)


def test_picture_is_written_and_the_same_every_time(tmp_path):
    schedule = schedule_of("INS_atan")
    for name in ("first.png", "second.png"):
        schedule_picture(schedule, "INS_atan", tmp_path / name)
    first, second = ((tmp_path / name).read_bytes() for name in ("first.png", "second.png"))
    assert first[:4] == b"\x89PNG"
    assert first == second
