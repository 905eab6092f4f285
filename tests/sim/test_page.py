"""The page of a run: its contents, and, in a browser, its curves and its attitude."""

import base64
import json
import re
from html import escape

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown_sim.page import Curve, MissingPlotlyError, Panel, write_page
from strapdown_sim.page.html import POINTS, TO_ENU

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
        Panel("yaw (°)", [Curve("hardware", YAW, turns=True)]), Panel("error (°)", [Curve("error", spiked)])],
        status={"at_rest": TIME % 20 < 5, "refused": np.zeros(COUNT, bool)}, gaps=[(30, 32)],
        quaternion=Rotation.from_euler("z", YAW[:, None], degrees=True).as_quat()[:, [3, 0, 1, 2]],
        facts=[("recording", "<a>")])
    return path


def test_contents(page):
    text = page.read_text(encoding="utf-8")
    assert f"<h1>{escape(TITLE)}</h1>" in text
    assert "<td>&lt;a&gt;</td>" in text
    assert "at_rest" in text
    # A bit that is never set has no band.
    assert '"refused"' not in text
    # Nothing is loaded from a network.
    assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?!data:)', text)


def test_long_runs_keep_their_extremes(page):
    (run,) = re.findall(r"const run = (.*);</script>", page.read_text(encoding="utf-8"))
    assert len(json.loads(run)["time"]) == POINTS
    assert TIME[SPIKE] in _points(page, "error")[0]
    assert max(_points(page, "error")[1]) == 7.0


def _points(page, name):
    """Times and values of a curve, from the data of plotly."""
    figure = re.findall(r'Plotly\.newPlot\(\s*"curves",\s*(\[.*?\]),\s*\{"template"', page.read_text(encoding="utf-8"),
                        re.DOTALL)[0]
    (trace,) = (trace for trace in json.loads(figure) if trace["name"] == name)
    return [np.frombuffer(base64.b64decode(trace[axis]["bdata"]), trace[axis]["dtype"]) for axis in "xy"]


@pytest.mark.parametrize("frame", TO_ENU)
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
            # Half of the yaw at that time; one decimal of the page is half of 0.001.
            half = np.radians(np.interp(time, TIME, YAW)) / 2
            assert abs(np.cos(half) * w + np.sin(half) * z) > np.cos(0.002)
            assert browser.execute_script(canvas) != before
        assert browser.get_log("browser") == []
