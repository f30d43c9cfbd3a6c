"""Tables of the README and of docs/, between the marks that name the script which writes them."""

from pathlib import Path

ROOT = Path(__file__).parents[2]


def pages() -> list[Path]:
    """The README and every page of docs/."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def update(name: str, text: str) -> None:
    """Write a table between <!-- name --> and <!-- /name --> of every page that has the marks."""
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    marked = [page for page in pages() if start in page.read_text(encoding="utf-8")]
    if not marked:
        raise ValueError(f"expected a page with {start}, got none; put the marks into a page")
    for page in marked:
        before, rest = page.read_text(encoding="utf-8").split(start)
        _, after = rest.split(end)
        page.write_text(f"{before}{start}\n{text}\n{end}{after}", encoding="utf-8")


def table_of(name: str) -> str:
    """Table that the first page with the marks of that name has now."""
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    for page in pages():
        text = page.read_text(encoding="utf-8")
        if start in text:
            return text.split(start)[1].split(end)[0].strip()
    raise ValueError(f"expected a page with {start}, got none; put the marks into a page")
