"""The report in a browser: what its script and its style do for a reader.

Oracle: headless Chromium, with mouse, keyboard and printer. Property: nothing is fetched, nothing
is complained about, and without a script every word is still there.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from runtime.outputs.report.report import write_report
from tests.browser import Watched, chromium
from tests.runtime.pages import write

WIDE = {"viewport": {"width": 1300, "height": 900}}
NARROW = {"viewport": {"width": 400, "height": 800}}
MASSES = "section:has(h3:text-is('Physical consistency per link')) table"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as opened:
        yield opened


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_report(write(tmp_path_factory.mktemp("page")))


def box_of(page: Any) -> list[float]:
    """The part of the first figure that is shown: x, y, width, height."""
    return [float(v) for v in page.locator("svg").first.get_attribute("viewBox").split()]


def test_a_header_sorts_its_table_up_down_and_back(browser: Any, report: Path) -> None:
    seen = Watched(browser, report, **WIDE)
    given = seen.column(MASSES, 2)
    assert given == ["2.5000", "3.5000"]
    head = seen.page.locator(f"{MASSES} th").nth(2)
    orders = []
    for _ in range(3):
        head.locator("button").click()
        orders.append((head.get_attribute("aria-sort"), seen.column(MASSES, 2)))
    assert orders == [("ascending", given), ("descending", given[::-1]), ("none", given)]
    assert not seen.complaints + seen.requests
    seen.page.close()


def test_numbers_sort_as_numbers_and_dashes_last(browser: Any, tmp_path: Path) -> None:
    """Property: 9 < 10 % < 1e3, text by its words, – below everything in both directions."""
    values = [1e3, None, 9.0, 10.0]

    def four(raw: dict[str, Any]) -> None:
        raw.update(joints=["j10", "j9", "b", "a"], units=["N*m"] * 4, friction=None)
        raw.update(links=[], weights=[1.0] * 4)
        raw["torque_error_percent"].update(before=values, after=[1.0] * 4)
        raw["torque_rms"].update(before=[1.0] * 4, after=[1.0] * 4)

    folder = write(tmp_path, four, joints=4)
    seen = Watched(browser, write_report(folder), **WIDE)
    table = "section:has(h3:text-is('Torque error per joint')) table"
    button = seen.page.locator(f"{table} th button").nth(1)
    button.click()
    assert seen.column(table, 0) == ["b", "a", "j10", "j9"]
    button.click()
    assert seen.column(table, 0) == ["j10", "a", "b", "j9"]
    seen.page.locator(f"{table} th button").first.click()
    assert seen.column(table, 0) == ["a", "b", "j9", "j10"]
    assert seen.page.locator(f"{table} tfoot").inner_text().startswith("all joints")
    seen.page.close()


def test_a_figure_zooms_by_wheel_keys_and_buttons(browser: Any, report: Path) -> None:
    seen = Watched(browser, report, **WIDE)
    page = seen.page
    home = box_of(page)
    figure = page.locator(".figure").first
    figure.scroll_into_view_if_needed()
    page.locator("svg").first.hover()
    page.mouse.wheel(0, -300)
    assert box_of(page) == home  # not focused: the page scrolls
    figure.scroll_into_view_if_needed()
    page.locator("svg").first.click()
    page.mouse.wheel(0, -300)
    page.wait_for_function("document.querySelector('.figure').classList.contains('zoomed')")
    closer = box_of(page)
    assert closer[2] < 0.7 * home[2]
    assert closer[2] / closer[3] == pytest.approx(home[2] / home[3], rel=1e-3)  # 3 decimals
    assert home[0] < closer[0] < closer[0] + closer[2] < home[0] + home[2]
    spot = page.locator("svg").first.bounding_box()
    page.mouse.move(spot["x"] + 200, spot["y"] + 200)
    page.mouse.down()
    page.mouse.move(spot["x"] + 260, spot["y"] + 220, steps=3)
    page.mouse.up()
    moved = box_of(page)
    # 60 px to the right shows what lies 60 px further left
    assert moved[0] == pytest.approx(closer[0] - 60 * closer[2] / spot["width"], abs=0.1)
    page.locator("svg").first.dblclick()
    assert box_of(page) == home
    page.keyboard.press("+")
    page.keyboard.press("+")
    page.keyboard.press("ArrowRight")
    assert box_of(page)[2] == pytest.approx(home[2] / 1.25**2, abs=0.01)
    page.keyboard.press("0")
    page.get_by_role("button", name="zoom in").first.click()
    assert box_of(page)[2] == pytest.approx(home[2] / 1.6, abs=0.01)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert box_of(page) == home
    assert not seen.complaints + seen.requests
    page.close()


def test_the_contents_lead_to_every_section(browser: Any, report: Path) -> None:
    seen = Watched(browser, report, **WIDE)
    page = seen.page
    titles = page.locator("section h3").all_inner_texts()
    links = page.locator("nav a:not(.group)")
    assert links.all_inner_texts() == titles
    links.nth(len(titles) // 2).click()
    page.wait_for_function("document.querySelector('nav a[aria-current]')")
    place = page.locator("section").nth(len(titles) // 2).bounding_box()
    assert 0 <= place["y"] < 100
    assert page.locator("nav").bounding_box()["y"] == 0  # still there
    page.close()


def test_a_phone_scrolls_tables_and_not_the_page(browser: Any, report: Path) -> None:
    seen = Watched(browser, report, **NARROW)
    width = "[document.documentElement.scrollWidth, innerWidth]"
    assert seen.page.evaluate(width) == [400, 400]
    assert seen.page.locator("nav").bounding_box()["height"] < 60
    assert not seen.complaints + seen.requests
    seen.page.close()


def test_print_leaves_out_what_paper_cannot_do(browser: Any, report: Path) -> None:
    seen = Watched(browser, report, color_scheme="dark", **WIDE)
    page = seen.page
    ground = "getComputedStyle(document.body).backgroundColor"
    assert page.evaluate(ground) == "rgb(20, 23, 27)"
    page.emulate_media(media="print")
    assert page.evaluate(ground) == "rgb(255, 255, 255)"
    for hidden in ("nav", ".tools"):
        assert not page.locator(hidden).first.is_visible()
    assert page.locator("table").first.is_visible()
    assert len(page.pdf()) > 10_000
    page.close()


def test_without_a_script_every_word_is_there(browser: Any, report: Path) -> None:
    bare = Watched(browser, report, java_script_enabled=False, **WIDE)
    full = Watched(browser, report, **WIDE)
    words = [set(seen.page.inner_text("main").split()) for seen in (bare, full)]
    assert words[0] <= words[1]
    assert bare.page.locator("th").first.inner_text() == "joint"
    assert bare.page.locator("nav a").count() == full.page.locator("nav a").count()
    assert bare.page.locator("svg").first.is_visible()
    bare.page.close()
    full.page.close()
