"""A page in a browser without a window: Debian's Chromium, driven by selenium.

As a program, with ``build/demo/replay.html docs/replay.png``, it draws the picture of docs/recordings.md; with
``build/optical/optical.html docs/optical_page.png``, that of docs/optical.md, from its second command with ``--html``.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import which

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains

__all__ = ["hover", "opened", "screenshot"]


@contextmanager
def opened(page: Path) -> Iterator[webdriver.Chrome]:
    """Context manager: a browser with a page, and a log of its console."""
    options = webdriver.ChromeOptions()
    for option in "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1400,1300":
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options=options, service=Service(which("chromedriver")))
    try:
        browser.get(page.resolve().as_uri())
        yield browser
    finally:
        browser.quit()


def hover(browser: webdriver.Chrome, right: float) -> None:
    """Move the cursor over the curves, to a fraction of the width of the first panel."""
    panel = browser.find_element("css selector", "#curves .nsewdrag")
    place = round(panel.size["width"] * (right - 0.5))
    ActionChains(browser).move_to_element_with_offset(panel, place, 0).pause(1).perform()


def screenshot(page: Path, picture: Path) -> None:
    """Write a picture of a page with the cursor in its middle, as PNG."""
    with opened(page) as browser:
        hover(browser, 0.5)
        browser.save_screenshot(str(picture))


if __name__ == "__main__":
    screenshot(*map(Path, sys.argv[1:]))
