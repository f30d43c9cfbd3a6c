"""The short table of the README: the widest level that runs here against the peers."""

from pathlib import Path

from bench.kernels import Report

START, END = "<!-- bench_kernels -->", "<!-- /bench_kernels -->"
README = Path(__file__).parents[2] / "README.md"


def markdown(report: Report) -> str:
    """One row per kernel at the last level: ns per sample, and how many times longer peers take."""
    level = report.rows[-1].level
    peers = [label for label in report.peers if label != "NumPy"]
    lines = [
        f"| kernel ({level}) | ns per sample | {' | '.join(peers)} |",
        "|---" * (len(peers) + 2) + "|",
    ]
    for row in report.rows:
        if row.level == level:
            found = [row.peers.get(label) for label in peers]
            cells = [f"{item.ratio:.0f}×" if item else "" for item in found]
            lines.append(f"| `{row.kernel}` | {row.ns:.0f} | {' | '.join(cells)} |")
    return "\n".join(lines)


def update(report: Report) -> None:
    """Write the table between its marks in README.md."""
    before, rest = README.read_text(encoding="utf-8").split(START)
    _, after = rest.split(END)
    README.write_text(f"{before}{START}\n{markdown(report)}\n{END}{after}", encoding="utf-8")
