"""The page of many runs: its contents, and, in a browser, its order and the row of a point."""

import re

import pytest

from strapdown_sim.page import Column, MissingPlotlyError, TablePage, write_table_page

COLUMNS = (Column("file", "file"), Column("samples", "samples", ",d"), Column("error_deg", "error (°)", ".2f"),
           Column("note", "note"))
ROWS = [{"file": "b <1>.csv", "samples": 900, "error_deg": 2.5, "note": None},
        {"file": "a/ä.ulg", "samples": 12_000, "error_deg": 10.0, "note": "</script>"},
        {"file": "c.bag", "samples": None, "error_deg": None, "note": "refused"}]


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "batch.html"
    write_table_page(path, TablePage(
        title="3 logs & more", columns=COLUMNS, rows=ROWS,
        links={row["file"]: f"logs/{row['file']}" for row in ROWS[:2]},
        panels={"error (°)": ["error_deg"], "nothing": ["height_m"]}))
    return path


def test_contents(page):
    text = page.read_text(encoding="utf-8")
    assert "<h1>3 logs &amp; more</h1>" in text
    assert '<a href="logs/b%20%3C1%3E.csv/">b &lt;1&gt;.csv</a>' in text
    assert '<th scope="row">c.bag</th><td class="number" data-value=""></td>' in text
    assert '<td class="number" data-value="12000">12,000</td>' in text
    assert "&lt;/script&gt;</td>" in text
    assert "nothing" not in re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    # Nothing is loaded from a network.
    assert not re.findall(r'<(?:script|link|img)[^>]*(?:src|href)="(?!data:)', text)


def test_without_plotly_one_line_names_the_command(tmp_path, monkeypatch):
    monkeypatch.setattr("strapdown_sim.page.html.find_spec", lambda name: None)
    with pytest.raises(MissingPlotlyError, match=r"pip install 'strapdown\[html\]'"):
        write_table_page(tmp_path / "a.html", TablePage("a", COLUMNS, ROWS, {}, {}))


@pytest.mark.ip
def test_in_a_browser(page):
    from strapdown_lab.browser import opened

    with opened(page) as browser:
        def files():
            return [row.text for row in browser.find_elements("css selector", "tbody tr > th")]

        def click(title):
            next(each for each in browser.find_elements("css selector", "thead button") if each.text == title).click()

        names = [row["file"] for row in ROWS]
        assert files() == names
        click("samples")
        assert files() == names
        # By number, not by text; a row without a value is the last one in both orders.
        click("samples")
        assert files() == [names[1], names[0], names[2]]
        click("file")
        click("file")
        assert files() == [names[2], names[0], names[1]]
        assert browser.execute_script("return document.querySelectorAll('#curves .point').length") == 2
        # The point of the second row.
        browser.execute_script("document.getElementById('curves').emit('plotly_click', {points: [{x: 1}]})")
        assert browser.find_element("css selector", "tr.chosen > th").text == names[1]
        assert browser.get_log("browser") == []
