"""Tables of the README, between the marks that name the script which writes them."""

from pathlib import Path

README = Path(__file__).parents[2] / "README.md"


def update(name: str, text: str) -> None:
    """Write `text` between <!-- name --> and <!-- /name --> of README.md."""
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    before, rest = README.read_text(encoding="utf-8").split(start)
    _, after = rest.split(end)
    README.write_text(f"{before}{start}\n{text}\n{end}{after}", encoding="utf-8")
