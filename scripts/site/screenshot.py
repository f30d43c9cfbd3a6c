"""Pictures of a report in a headless Chromium: the README's, and one with numbers for both schemes.

`scripts/docs --screenshot` identifies the real Panda log as `scripts/demo` does, and takes them.
"""

import shutil
import subprocess
import sys

from playwright.sync_api import sync_playwright

from scripts.site.figures import IMAGES, ROOT, SCHEMES

REPORT = ROOT / "results" / "pictures" / "report.html"
IDENTIFY = ("identify", "panda_gaz", "--robot", "fr3", "--out", str(REPORT.parent))
PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT, LONGER = 1000, 760, 1140
"""Size of the README's picture, and height of the one with numbers [px]."""
NOTED = ("[id^=s-torque-error] h3", ".tile:nth-child(2)", ".tile:nth-child(3)", ".warnings")
"""What the tutorial `fr3` explains, in its order."""
MARK = """([selector, number]) => {
    const place = document.querySelector(selector).getBoundingClientRect();
    const mark = document.createElement("div");
    mark.textContent = number;
    mark.style = `position: absolute; left: ${place.right - 34}px; top: ${place.top + 6}px;
        width: 26px; height: 26px; border-radius: 13px; background: #d9822b; color: #fff;
        font: bold 16px/26px sans-serif; text-align: center`;
    document.body.append(mark);
}"""


def main() -> None:
    """Write docs/images/report.png and report-notes-light.png, report-notes-dark.png."""
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        raise SystemExit("screenshot: expected chromium on the path, got none; install it")
    subprocess.run([sys.executable, "-m", "runtime", *IDENTIFY], cwd=ROOT, check=True)
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for scheme in SCHEMES:
            page = browser.new_page(color_scheme=scheme)
            page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
            page.goto(REPORT.as_uri())
            page.wait_for_timeout(500)
            if scheme == "light":
                page.screenshot(path=IMAGES / "report.png")
            page.set_viewport_size({"width": WIDTH, "height": LONGER})
            for number, selector in enumerate(NOTED, start=1):
                page.evaluate(MARK, [selector, number])
            page.screenshot(path=IMAGES / f"report-notes-{scheme}.png")
        browser.close()


if __name__ == "__main__":
    main()
