"""A headless Chromium for tests, Debian's own, driven by playwright; absent is a loud skip."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")


@contextmanager
def chromium(*options: str) -> Iterator[Any]:
    """A browser of playwright's; the test is skipped where it, or Chromium, is missing.

    Without options it draws pages only, without the emulation of a graphics card.
    """
    sync = pytest.importorskip(
        "playwright.sync_api",
        reason="NOT LOOKED AT IN A BROWSER: playwright is missing: pip install 'symgen[test]'",
    )
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip("NOT LOOKED AT IN A BROWSER: no chromium on the path: apt install chromium")
    with sync.sync_playwright() as play:
        browser = play.chromium.launch(
            executable_path=program, args=["--no-sandbox", *(options or ["--disable-gpu"])]
        )
        try:
            yield browser
        finally:
            browser.close()


class Watched:
    """A page whose complaints and requests are kept.

    Attributes:
        complaints: errors and warnings of the console, and exceptions.
        requests: addresses of requests other than that of the page.
    """

    def __init__(self, browser: Any, path: Path, **options: Any) -> None:
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page = browser.new_page(**options)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("console", self._on_console)
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.resolve().as_uri())
        self.requests.remove(path.resolve().as_uri())

    def _on_console(self, message: Any) -> None:
        if message.type in {"error", "warning"}:
            self.complaints.append(message.text)

    def column(self, table: str, number: int) -> list[str]:
        """The text of a column of the rows as they stand, from 0."""
        cells = self.page.locator(f"{table} tbody tr > :nth-child({number + 1})")
        return [text.strip() for text in cells.all_inner_texts()]
