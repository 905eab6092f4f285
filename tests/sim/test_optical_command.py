"""``strapdown optical``: flights and recorded lines through OPT_top, files, pictures, and errors in one line."""

import json
import re

import numpy as np
import pytest
from click.testing import CliRunner
from matplotlib.image import imsave
from PIL import Image
from scipy.spatial.transform import Rotation

from strapdown.cli import main
from strapdown_sim import optical
from strapdown_sim.instrument.errors import InstrumentError
from strapdown_sim.instrument.scene import camera_options
from strapdown_sim.optical_page import lost_lines
from strapdown_sim.optical_picture import angles_picture as picture
from strapdown_sim.optical_picture import run_begin
from strapdown_sim.recordings import RecordingError
from strapdown_sim.recordings.lines import FULL_SCALE, read_lines

PIXELS = 2048


def recorded():
    """Four lines of each sensor with a spot, shape (2, 4, pixels)."""
    place = np.arange(PIXELS)
    spots = np.array([[900.25 + k, 1200.5 - k] for k in range(4)]).T
    return np.rint(100 + 2800 * np.exp(-((place - spots[..., None]) / 4.6) ** 2 / 2)).astype(np.uint16)


def invoke(*words):
    return CliRunner().invoke(main, ["optical", *map(str, words)], catch_exceptions=False)


def refused(*words):
    """The line with which a command ends."""
    result = invoke(*words)
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    return result.stderr.removeprefix("strapdown: ").strip()


# Whole runs.

@pytest.mark.verilator
def test_flight(tmp_path, models, monkeypatch):
    drawn = {}
    monkeypatch.setattr(optical, "angles_picture",
                        lambda path, **given: (drawn.update(given), picture(path, **given)))
    result = invoke("c", "--lines", 8, "--start", 20, "--output", tmp_path, "--build", models, "--camera", "prnu=0.01",
                    "--camera", "laser=true", "--show", 3, "--html")
    assert result.exit_code == 0, result.output
    assert {path.name for path in tmp_path.iterdir()} >= {
        "OPT_top.v", "OPT_top.json", "summary.json", "angles.csv", "lines.png", "angles.png", "exposure.png",
        "budget.png"}
    summary = json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))
    assert summary["updates"] == 8
    assert summary["bits_differing_from_twin"] == 0
    assert summary["timing_violations"] == []
    assert summary["frames"] == {"received": 7, "lost": 0, "crc_errors": 0, "differing_from_twin": 0}
    assert summary["updates_with_both_spots"] == 7
    # The parts of the error add up.
    parts = summary["error_deg"]
    for axis in "roll", "pitch":
        assert parts["total"][axis]["max"] <= sum(
            parts[name][axis]["max"] for name in ("light", "equations", "arithmetic")) + 1e-9
        assert parts["total"][axis]["max"] < 0.01
        assert summary["position_error_px"][axis]["max"] < 0.2
    assert summary["source"] == "flight c from 20 s on, coordinated turn of 342°, bank 23°"
    table = np.genfromtxt(tmp_path / "angles.csv", delimiter=",", names=True)
    assert table.dtype.names[:3] == ("t", "roll", "pitch")
    assert len(table) == 8
    # 40 m/s with 6 deg/s: in the middle of the turn, with the rotor's axis still vertical.
    bank = np.degrees(np.arctan(40 * np.radians(6) / 9.80665))
    assert np.abs(table["roll_true"] - bank).max() < 1e-5
    assert np.abs(table["roll_measured"][1:] - bank).max() < 0.02
    assert "bits that differ from the twin" in result.output
    counts = summary["counts"]
    assert 80 < counts["least"] < 110
    assert 2500 < counts["largest"] < 3300
    # Before the first position there is no angle to draw.
    for values in *drawn["angles"], *drawn["measured"]:
        assert np.flatnonzero(np.isnan(values)).tolist() == [0]
    assert f"{counts['least']} to {counts['largest']:,}" in result.output
    check_page((tmp_path / "optical.html").read_text(encoding="utf-8"), table)


def check_page(text, table):
    """A page has the numbers of angles.csv, and each line has its spot at the position there."""
    (run,) = (json.loads(data) for data in re.findall(r"const run = (.*);</script>", text))
    assert np.abs(np.array(run["time"]) - table["t"]).max() < 1e-6
    assert run["attitude"]["quaternion"][0] is None
    found = Rotation.from_quat(run["attitude"]["quaternion"][1:], scalar_first=True).as_euler("ZYX", degrees=True)
    # Four decimals of a quaternion are half of 1e-4, or 0.0057 degrees, and two of them make an angle.
    assert np.abs(found[:, 2] - table["roll"][1:]).max() < 0.02
    assert np.abs(found[:, 1] - table["pitch"][1:]).max() < 0.02
    assert [view["name"] for view in run["lines"]] == ["roll sensor", "pitch sensor"]
    for view, axis in zip(run["lines"], ("roll", "pitch"), strict=True):
        assert view["width"][0] == 0
        for update in range(1, len(table)):
            assert view["centre"][update] == pytest.approx(table[f"{axis}_px"][update], abs=1e-3)
            counts, first, begin = view["counts"][update], view["first"][update], view["begin"][update]
            threshold, width = view["levels"]["threshold"][update], view["width"][update]
            above = first + np.flatnonzero(np.array(counts) > threshold)
            assert above.tolist() == list(range(begin, begin + width))
            weights = np.array(counts)[above - first] - threshold
            assert np.average(above, weights=weights) == pytest.approx(view["centre"][update], abs=1e-3)
    assert "<th>bits that differ from the twin</th><td>0</td>" in text
    assert "roll missing" in text


@pytest.mark.parametrize("begin", [0, 250, 700])
def test_the_begin_of_a_run_among_runs_that_touch(begin):
    """All pixels are above the threshold, and a run of 300 of them is looked for."""
    counts = np.random.default_rng(begin).integers(200, 4000, 1000).astype(np.uint16)
    run = np.arange(begin, begin + 300)
    assert run_begin(counts, 150, np.average(run, weights=counts[run] - 150.0), 300) == begin


def test_numbers_of_lines_tell_which_are_lost():
    assert lost_lines(np.array([0, 1, 4, 65535, 0])).tolist() == [0, 2, 65530, 0]


@pytest.mark.verilator
def test_recorded_lines(tmp_path, models):
    roll, pitch = recorded()
    np.savez(tmp_path / "lines.npz", roll=roll, pitch=pitch)
    result = invoke(tmp_path / "lines.npz", "--output", tmp_path / "out", "--build", models)
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["updates"] == 4
    assert summary["bits_differing_from_twin"] == 0
    assert summary["updates_by_status"]["uncompensated"] == 4
    assert summary["error_deg"].keys() == {"arithmetic"}
    assert not (tmp_path / "out" / "budget.png").exists()
    table = np.genfromtxt(tmp_path / "out" / "angles.csv", delimiter=",", names=True)
    assert np.abs(table["roll_px"][1:] - [901.25, 902.25, 903.25]).max() < 0.01
    assert np.abs(table["pitch_px"][1:] - [1199.5, 1198.5, 1197.5]).max() < 0.01
    middle, scale = (PIXELS - 1) / 2, 14 / 25_000
    assert np.abs(table["roll"][1:] - np.degrees(np.arctan((table["roll_px"][1:] - middle) * scale))).max() < 1e-4


# Files of lines.

def test_formats_of_lines(tmp_path):
    lines = recorded()
    rows = np.concatenate(list(lines), axis=1)
    np.savez(tmp_path / "a.npz", roll=lines[0], pitch=lines[1])
    np.savetxt(tmp_path / "a.csv", rows, fmt="%d", delimiter=",")
    assert np.array_equal(read_lines(tmp_path / "a.npz", PIXELS), lines)
    assert np.array_equal(read_lines(tmp_path / "a.csv", PIXELS), lines)
    (tmp_path / "mark.csv").write_text((tmp_path / "a.csv").read_text(encoding="utf-8"), encoding="utf-8-sig")
    assert np.array_equal(read_lines(tmp_path / "mark.csv", PIXELS), lines)
    Image.fromarray(np.rint(rows * (65535 / FULL_SCALE)).astype(np.uint16)).save(tmp_path / "a.png")
    assert np.array_equal(read_lines(tmp_path / "a.png", PIXELS), lines)
    Image.fromarray(rows).save(tmp_path / "counts.png")
    assert np.array_equal(read_lines(tmp_path / "counts.png", PIXELS, FULL_SCALE), lines)
    assert np.array_equal(read_lines(tmp_path / "counts.png", PIXELS, 65535), np.rint(lines / (65535 / FULL_SCALE)))
    Image.fromarray((rows >> 4).astype(np.uint8)).save(tmp_path / "grey.png")
    assert np.abs(read_lines(tmp_path / "grey.png", PIXELS).astype(int) - lines).max() <= 16


def test_files_that_hold_no_lines(tmp_path):
    def told(name, full_scale=None):
        with pytest.raises(RecordingError) as caught:
            read_lines(tmp_path / name, 4, full_scale)
        text = str(caught.value)
        assert "\n" not in text
        return text.removeprefix(f"{tmp_path / name}: ")

    good = np.zeros((2, 4))
    assert told("a.txt") == "suffix '.txt' is not known; lines are in .npz, .csv or .png files"
    assert told("a.npz") == "No such file or directory"
    (tmp_path / "a.npz").write_text("no archive", encoding="utf-8")
    assert told("a.npz") == "not a NumPy archive of plain arrays; write it with numpy.savez"
    np.savez(tmp_path / "b.npz", roll=good)
    assert told("b.npz") == "no array 'pitch'; add it"
    np.savez(tmp_path / "c.npz", roll=good, pitch=np.zeros((2, 5)))
    assert told("c.npz") == "the pitch sensor has lines in shape (2, 5); the configuration's sensor needs (lines, 4)"
    np.savez(tmp_path / "d.npz", roll=good + np.nan, pitch=good)
    assert told("d.npz") == "the lines of the roll sensor must be finite numbers"
    np.savez(tmp_path / "e.npz", roll=good + 5000, pitch=good)
    assert told("e.npz") == "the roll sensor has counts from 5000 to 5000; they must be from 0 to 4095"
    np.savez(tmp_path / "h.npz", roll=good, pitch=good + 0.5)
    assert told("h.npz") == "the pitch sensor has the count 0.5; counts must be whole numbers, so round them"
    np.savez(tmp_path / "f.npz", roll=good, pitch=np.zeros((3, 4)))
    assert told("f.npz") == "2 lines of the roll sensor and 3 of the pitch sensor; cut the longer one"
    (tmp_path / "a.csv").write_text("1,2,x\n", encoding="utf-8")
    assert told("a.csv").startswith("not a table of numbers: ")
    (tmp_path / "b.csv").write_text("\n", encoding="utf-8")
    assert told("b.csv") == "the file is empty"
    (tmp_path / "a.png").write_bytes(b"no picture")
    assert told("a.png") == "not a PNG picture"
    Image.fromarray(np.full((2, 8), 3000, np.uint16)).save(tmp_path / "c.png")
    assert told("c.png") == ("a picture of 16 bits with no value above 3000; say what is full scale: --full-scale 4095 "
                             "if the values are counts of 12 bits, --full-scale 65535 if not")
    assert told("c.png", full_scale=2000).startswith("the roll sensor has counts from 6142 to 6142; ")
    np.savez(tmp_path / "g.npz", roll=good, pitch=good)
    assert told("g.npz", full_scale=4095) == "holds counts; only pictures have a full scale"
    imsave(tmp_path / "b.png", np.zeros((2, 8, 3)))
    assert told("b.png") == "the picture has colours; it must be grey"


# Errors.

def test_camera_options():
    assert camera_options(["prnu=0.02", "laser=false"]) == {"prnu": 0.02, "laser": False}
    for word, told in (
            ("prnu", "the camera takes FIELD=VALUE, as in prnu=0.02, not 'prnu'"),
            ("colour=1", "the camera has no field 'colour': choose from sigma_px, peak, "),
            ("laser=1", "laser of the camera must be true or false, not '1'"),
            ("prnu=much", "prnu of the camera must be a number, not 'much'"),
            ("prnu=-1", "prnu of the camera must be a finite number from 0, not -1")):
        with pytest.raises(InstrumentError) as caught:
            camera_options([word])
        assert str(caught.value).startswith(told)


def test_a_page_needs_plotly(tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown_sim.page.html.find_spec", lambda name: None)
    assert refused("--html", "--output", tmp_path / "out") == (
        "a page in HTML needs plotly: pip install 'strapdown[html]'")
    assert not (tmp_path / "out").exists()


def test_commands_that_are_refused(tmp_path):
    assert refused("x") == "there is no flight and no file 'x': flights are a, b, c, d, e, f, g"
    assert refused("--config", "mahony") == (
        "configuration mahony has no OPT_top: choose from optical_tcd1304, optical_s11639, optical_erected")
    assert refused("--lines", 5, "--seconds", 1) == "--lines and --seconds exclude each other: give only one of them"
    for number in "nan", "inf":
        assert refused("--seconds", number) == f"--seconds must be a finite number, not {number}"
    result = invoke("--seed", -1)
    assert result.exit_code == 2
    assert "'--seed': -1 is not in the range" in result.stderr
    assert refused("a", "--seconds", 70) == "140000 lines take 70.001 s, and the flight lasts 60 s"
    assert refused("a", "--start", 59.95) == "200 lines from 59.95 s on take 0.101 s, and the flight lasts 60 s"
    assert refused("--start", "inf") == "--start must be a finite number, not inf"
    assert refused("--set", "trigger=external") == (
        "configuration optical_s11639: a run needs trigger=internal, not 'external'")
    assert refused("--full-scale", 4095) == "--full-scale is that of a picture, and a flight has none"
    assert refused("--camera", "colour=1").startswith("the camera has no field 'colour'")
    np.savez(tmp_path / "lines.npz", roll=recorded()[0], pitch=recorded()[1])
    assert refused(tmp_path / "lines.npz", "--camera", "prnu=0") == (
        "--camera changes the light of a flight, and recorded lines have their own")
    assert refused(tmp_path / "lines.npz", "--start", 1) == (
        "--start is a time of a flight, and recorded lines begin with the first")
    assert "needs (lines, 3648)" in refused(tmp_path / "lines.npz", "--config", "optical_tcd1304")
    (tmp_path / "calibration.json").write_text("{}", encoding="utf-8")
    assert refused("--calibration", tmp_path / "calibration.json") == (
        f"{tmp_path / 'calibration.json'} is not a calibration.json of 'strapdown calibrate optical'")
