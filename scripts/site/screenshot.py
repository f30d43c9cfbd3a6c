"""The picture of a report in the README: results/demo/report.html in a headless Chromium.

Run scripts/demo first. `scripts/docs --screenshot` takes the picture.
"""

import shutil
from pathlib import Path

from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[2]
REPORT = ROOT / "results" / "demo" / "report.html"
PICTURE = ROOT / "docs" / "images" / "report.png"
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT = 1000, 760


def main() -> None:
    """Write docs/images/report.png, the first screen of the report."""
    if not REPORT.exists():
        raise SystemExit(f"screenshot: expected '{REPORT}', got no such file; run scripts/demo")
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        raise SystemExit("screenshot: expected chromium on the path, got none; install it")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        page.goto(REPORT.as_uri())
        page.wait_for_timeout(500)
        page.screenshot(path=PICTURE)
        browser.close()


if __name__ == "__main__":
    main()
