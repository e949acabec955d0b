"""The report in a real browser: it works, asks for nothing outside, and can be read."""

import base64
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser, Page, chromium

from mfopt.arrays import AnyArray, Array
from mfopt.campaign.store import RunDirectory
from reports import DesignView, write_report

pytestmark = pytest.mark.skipif(
    CHROMIUM is None, reason="Chromium is not installed: the report is not tried in a browser"
)
LEAST_CONTRAST = 4.5  # WCAG 2.2, 1.4.3
WIDTHS = [400, 1400]

# Elements whose content is wider than they are, or that stand out of the window.
CUT_OFF = """
[...document.body.querySelectorAll("*")].filter((e) => {
  if (!e.checkVisibility() || e.closest("svg")) return false;
  const box = e.getBoundingClientRect();
  const wide = e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).overflowX !== "visible";
  return wide || box.right > innerWidth + 1 || box.left < -1;
}).map((e) => `${e.tagName} ${e.className} ${e.textContent.slice(0, 60)}`)
"""
# Contrast of each visible text against the nearest background behind it.
CONTRASTS = """
(() => {
  const numbers = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const light = (rgb) => {
    const [r, g, b] = rgb.slice(0, 3).map((c) => c / 255)
      .map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (e) => {
    for (; e; e = e.parentElement) {
      const rgba = numbers(getComputedStyle(e).backgroundColor);
      if (rgba.length === 3 || rgba[3] > 0) return rgba;
    }
    return [255, 255, 255];
  };
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const found = [];
  for (let text; (text = texts.nextNode());) {
    const e = text.parentElement;
    if (!text.data.trim() || !e.checkVisibility() || e.closest("script, style")) continue;
    const [a, b] = [numbers(getComputedStyle(e).color), behind(e)].map(light);
    found.push([(Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05), text.data.trim().slice(0, 60)]);
  }
  return found;
})()
"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One Chromium for all tests."""
    with chromium(tmp_path_factory.mktemp("chromium")) as its:
        yield its


@pytest.fixture(scope="module")
def html(
    finished_run: RunDirectory,
    machine: Callable[[Array], DesignView],
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    """The page of a finished run."""
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(finished_run, describe=machine, html=path)
    return path


@pytest.fixture(params=WIDTHS)
def page(request: pytest.FixtureRequest, browser: Browser, html: Path) -> Iterator[Page]:
    """The page, open at each width."""
    with browser.page() as its:
        its.open(html, width=request.param)
        yield its


def changed(a: AnyArray, b: AnyArray) -> float:
    """Share of pixels that differ."""
    return float((a != b).any(axis=2).mean())


def test_the_page_works_turns_and_is_legible(page: Page) -> None:
    still = page.picture("#viewer")
    assert len(np.unique(still.reshape(-1, 3), axis=0)) > 20  # there is a machine to be seen
    assert changed(still, page.picture("#viewer")) == 0.0
    page.drag("#viewer", 80, 30)
    by_mouse = page.picture("#viewer")
    assert changed(still, by_mouse) > 0.01
    page.value("document.getElementById('viewer').focus()")
    for _ in range(3):
        page.press("ArrowLeft")
    assert changed(by_mouse, page.picture("#viewer")) > 0.01

    assert page.value(CUT_OFF) == []
    assert page.value("document.documentElement.scrollWidth <= innerWidth")
    contrasts = page.value(CONTRASTS)
    assert len(contrasts) > 200
    assert [its for its in contrasts if its[0] < LEAST_CONTRAST] == []

    assert page.complaints() == []
    outside = [url for url in page.addresses() if not url.startswith(("file:", "data:"))]
    assert outside == []
    assert len([url for url in page.addresses() if url.startswith("file:")]) == 1


def test_a_chosen_design_is_shown_in_three_dimensions(browser: Browser, html: Path) -> None:
    with browser.page() as page:
        page.open(html, width=1400)
        best = page.picture("#viewer")
        page.value("document.querySelectorAll('button[data-design]')[1].click()")
        assert changed(best, page.picture("#viewer")) > 0.005
        assert page.value("document.getElementById('viewer-label').textContent") == "baseline"


def test_without_scripts_pictures_stand_in_for_the_viewer(browser: Browser, html: Path) -> None:
    with browser.page() as page:
        page.open(html, width=400, scripts=False)
        assert page.value("document.getElementById('viewer').checkVisibility()") is False
        assert page.value("document.querySelector('.shapes img').checkVisibility()") is True
        assert page.value("document.documentElement.scrollWidth <= innerWidth")


def test_text_in_drawings_is_legible(html: Path) -> None:
    found = re.findall(r"data:image/svg\+xml;base64,([^\"]+)", html.read_text(encoding="utf-8"))
    drawings = [base64.b64decode(its).decode() for its in found]
    colours = {c for its in drawings for c in re.findall(r"<text[^>]*fill: (#[0-9a-f]{6})", its)}
    assert len(colours) > 2
    for colour in colours:
        channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
        linear = np.where(
            channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4
        )
        assert 1.05 / (float(linear @ [0.2126, 0.7152, 0.0722]) + 0.05) >= LEAST_CONTRAST, colour
