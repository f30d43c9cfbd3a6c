"""The page of the generated C: the README and the header of the bundled robot."""

import re
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "generated" / "fr3"
COMMENT = re.compile(r"/\*\*?(.*?)\*/\s*((?:int|void|double|const|unsigned)[^;{]*;)", re.DOTALL)


def markdown() -> str:
    """Text of the robot's README below a sentence, headings one level deeper, then the header."""
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    header = (FOLDER / "fr3.h").read_text(encoding="utf-8")
    body = re.sub(r"^#", "##", readme, flags=re.MULTILINE)
    return "\n".join(
        [
            "# C API",
            "",
            "`symgen build` writes this folder for every robot, here for the FR3. "
            "[Use the C code](../howto/c.md) shows how to call it.",
            "",
            body,
            "",
            "## The header",
            "",
            "```c",
            header.rstrip(),
            "```",
            "",
        ]
    )
