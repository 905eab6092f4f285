"""The page of a run: its contents, and, in a browser, its curves and its attitude."""

import base64
import json
import re
from html import escape
from io import BytesIO

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.spatial.transform import Rotation

from strapdown_sim.curves import FEW
from strapdown_sim.page import Curve, LineView, MissingPlotlyError, Panel, write_page
from strapdown_sim.page.html import LETTERS, POINTS, TO_ENU

COUNT = 10_000
TIME = np.arange(COUNT) / 100
YAW = 3.0 * TIME % 360
SPIKE = 4321
TITLE = "flight </script> & <b>"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """A page of a body that turns about the vertical."""
    path = tmp_path_factory.mktemp("page") / "replay.html"
    spiked = np.zeros(COUNT)
    spiked[SPIKE] = 7.0
    write_page(path, title=TITLE, time_s=TIME, panels=[
        Panel("yaw (°)", [Curve("hardware", YAW, turns=True)], note="clockwise"),
        Panel("error (°)", [Curve("error", spiked)])],
        status={"at_rest": TIME % 20 < 5, "refused": np.zeros(COUNT, bool)}, gaps=[(30, 32)],
        quaternion=Rotation.from_euler("z", YAW[:, None], degrees=True).as_quat()[:, [3, 0, 1, 2]],
        facts=[("recording", "<a>")])
    return path


def test_contents(page):
    text = page.read_text(encoding="utf-8")
    assert f"<h1>{escape(TITLE)}</h1>" in text
    assert "<td>&lt;a&gt;</td>" in text
    assert "at_rest" in text
    assert '"text":"clockwise"' in text
    # A bit that is never set has no band, and one that is set for a sample is marked.
    assert '"refused"' not in text
    assert _trace(page, "at_rest")["mode"] == "lines+markers"
    # Nothing is loaded from a network.
    assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?!data:)', text)


def test_long_runs_keep_their_extremes(page):
    (run,) = re.findall(r"const run = (.*);</script>", page.read_text(encoding="utf-8"))
    assert len(json.loads(run)["time"]) == POINTS
    time, values = _points(_trace(page, "error"))
    assert TIME[SPIKE] in time
    assert max(values) == 7.0


def _points(trace):
    """Times and values of a curve."""
    return [np.frombuffer(base64.b64decode(trace[axis]["bdata"]), trace[axis]["dtype"]) for axis in "xy"]


def _trace(page, name):
    """A curve, from the data of plotly."""
    figure = re.findall(r'Plotly\.newPlot\(\s*"curves",\s*(\[.*?\]),\s*\{"template"', page.read_text(encoding="utf-8"),
                        re.DOTALL)[0]
    (trace,) = (trace for trace in json.loads(figure) if trace["name"] == name)
    return trace


@pytest.mark.parametrize("count", [1, FEW, FEW + 1])
def test_few_points_are_marked(tmp_path, count):
    """Among many samples, too: one fix of a position, and samples that are drawn without lines."""
    few = np.full(COUNT, np.nan)
    few[100:100 + 50 * count:50] = 1.0
    write_page(tmp_path / "a.html", title="", time_s=TIME, status={}, panels=[Panel("a", [
        Curve("line", few), Curve("points", few, points=True)])])
    line, points = (_trace(tmp_path / "a.html", name) for name in ("line", "points"))
    assert line["mode"] == ("lines+markers" if count <= FEW else "lines")
    assert (points["marker"]["size"] > 3) == (count <= FEW)


@pytest.mark.parametrize("frame", sorted(TO_ENU.keys() - LETTERS))
def test_frames(frame):
    """East, north and up of each frame are a right-handed triad, with the axes that its name has."""
    enu = np.array(TO_ENU[frame])
    assert np.linalg.det(enu) == 1
    axes = {"E": enu[0], "W": -enu[0], "N": enu[1], "S": -enu[1], "U": enu[2], "D": -enu[2]}
    np.testing.assert_array_equal([axes[letter] for letter in frame], np.eye(3))


def test_without_plotly(tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown_sim.page.html.find_spec", lambda name: None)
    with pytest.raises(MissingPlotlyError, match=r"^a page in HTML needs plotly: pip install 'strapdown\[html\]'$"):
        write_page(tmp_path / "a.html", title="", time_s=TIME, panels=[], status={})


SPOT = 300 + 5 * np.sin(TIME)
"""Centre of a spot, pixels."""


@pytest.fixture(scope="module")
def page_of_lines(tmp_path_factory):
    """A page of one line sensor, whose spot is missing in the first half; there is no attitude at first."""
    path = tmp_path_factory.mktemp("lines") / "optical.html"
    first, begin = np.full(COUNT, 280), np.rint(SPOT).astype(int) - 5
    pixels = 280 + np.arange(40)
    counts = np.rint(2000 * np.exp(-((pixels - SPOT[:, None]) / 3) ** 2)).astype(int)
    quaternion = np.tile([1.0, 0, 0, 0], (COUNT, 1))
    quaternion[:10] = np.nan
    write_page(path, title="lines", time_s=TIME, status={}, panels=[Panel("position", [Curve("spot", SPOT)])],
               quaternion=quaternion, frame="level", lines=[LineView(
                   "roll sensor", first, counts, {"threshold": np.full(COUNT, 100)}, begin,
                   np.repeat([0, 10], COUNT // 2), SPOT)])
    return path


def test_the_frame_without_heading():
    assert TO_ENU["level"] == TO_ENU["NED"]


@pytest.mark.ip
def test_lines_in_a_browser(page_of_lines):
    """The line at the cursor is drawn, with its run and its centre, and the console has no message."""
    from strapdown_lab.browser import hover, opened

    def pixels(browser, colour):
        """Number of pixels of a colour on the canvas of the line."""
        url = browser.execute_script("return document.querySelector('#lines canvas').toDataURL()")
        image = imread(BytesIO(base64.b64decode(url.partition(",")[2])))[..., :3]
        return int((np.rint(image * 255) == colour).all(axis=-1).sum())

    with opened(page_of_lines) as browser:
        assert "no attitude, roll sensor: no spot" in browser.find_element("id", "reading").text
        run, curve = (0x8f, 0xc1, 0xea), (0x10, 0x24, 0x3e)
        for right in 0.25, 0.75:
            hover(browser, right)
            reading = browser.find_element("id", "reading").text
            assert pixels(browser, curve) > 500
            assert (pixels(browser, run) > 2000) == (right > 0.5)
            if right < 0.5:
                assert reading.endswith("q = (1.000, 0.000, 0.000, 0.000), roll sensor: no spot")
            else:
                time, centre = (float(number) for number in re.findall(r"(?:t =|sensor) (\S+)", reading))
                assert abs(time - right * TIME[-1]) < 1
                assert centre == pytest.approx(np.interp(time, TIME, SPOT), abs=1e-3)
        assert browser.get_log("browser") == []


@pytest.mark.ip
def test_in_a_browser(page):
    """The page draws, the cursor turns the body, and the console has no message."""
    from strapdown_lab.browser import hover, opened

    with opened(page) as browser:
        canvas = "return document.getElementById('attitude').toDataURL()"
        before = browser.execute_script(canvas)
        drawn = browser.execute_script("return document.querySelectorAll('#curves .scatterlayer .trace path').length")
        assert drawn >= 3
        for right in 0.25, 0.75:
            hover(browser, right)
            reading = browser.find_element("id", "reading").text
            time, w, *_, z = map(float, re.findall(r"-?\d+\.\d+", reading))
            assert abs(time - right * TIME[-1]) < 1
            # Half of the yaw at that time. Both numbers of the page are rounded to 0.001, so the sine of the difference
            # is at most 0.0005 sqrt(2).
            half = np.radians(np.interp(time, TIME, YAW)) / 2
            assert abs(np.cos(half) * z - np.sin(half) * w) < 0.001
            assert browser.execute_script(canvas) != before
        assert browser.get_log("browser") == []
