"""New <inertial> blocks in the text of a URDF; every other byte is kept.

The XML parser gives the positions of the blocks. Writing the document back from its tree would lose
comments, white space and the order of attributes.
"""

from xml.parsers import expat

from symgen.errors import UrdfError
from symgen.inspect.model import Body

_AXES = "xyz"


def with_bodies(text: str, bodies: dict[str, Body]) -> str:
    """Return the URDF with the <inertial> of the named links replaced."""
    data = text.encode()
    places = _places(data)
    missing = [name for name in bodies if name not in places]
    if missing:
        raise UrdfError(f"link '{missing[0]}' has no <inertial> to replace; add one")
    for name in sorted(bodies, key=lambda name: places[name], reverse=True):
        start, end = places[name]
        line = data.rfind(b"\n", 0, start) + 1
        blank = data[line:start].decode()
        indent = blank if not blank.strip() else ""
        data = data[:start] + _block(bodies[name], indent).encode() + data[end:]
    return data.decode()


def _places(data: bytes) -> dict[str, tuple[int, int]]:
    """Position of the first <inertial> of each link: first byte, and one past the last byte."""
    parser = expat.ParserCreate("utf-8")  # the text is UTF-8 now, whatever its header states
    path: list[str] = []
    link, start = "", 0
    places: dict[str, tuple[int, int]] = {}

    def opened(tag: str, attributes: dict[str, str]) -> None:
        nonlocal link, start
        path.append(tag)
        if path == ["robot", "link"]:
            link = attributes.get("name", "")
        if path == ["robot", "link", "inertial"]:
            start = parser.CurrentByteIndex

    def closed(_: str) -> None:
        if path == ["robot", "link", "inertial"] and link not in places:
            # At an end tag the index is that of "</"; at <inertial/> it is that of the start.
            end = data.index(b">", parser.CurrentByteIndex) + 1
            places[link] = (start, end)
        path.pop()

    parser.StartElementHandler, parser.EndElementHandler = opened, closed
    parser.Parse(data, True)
    return places


def _block(body: Body, indent: str) -> str:
    step = "\n" + indent + "  "
    entries = " ".join(
        f'i{_AXES[i]}{_AXES[j]}="{_digits(body.inertia[i, j])}"'
        for i in range(3)
        for j in range(i, 3)
    )
    xyz = " ".join(_digits(x) for x in body.com)
    return (
        f'<inertial>{step}<origin xyz="{xyz}" rpy="0 0 0"/>'
        f'{step}<mass value="{_digits(body.mass)}"/>'
        f"{step}<inertia {entries}/>\n{indent}</inertial>"
    )


def _digits(value: float) -> str:
    return repr(float(value) + 0.0)  # the shortest text that reads back to the same number
