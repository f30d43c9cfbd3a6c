"""Report of the kernels: table, footnotes, and the Markdown of the pages."""

from rich.table import Table

from bench.kernels import Report, Row

LABELS = {
    "base_inverse_dynamics": "τ (base parameters)",
    "inverse_dynamics": "τ (π)",
    "torque": "τ (λ)",
    "base_regressor": "Y_b",
    "regressor": "Y",
    "torque_jacobian": "∂τ/∂λ",
    "mass_matrix": "M",
    "forward_dynamics": "forward dynamics",
    "end_effector": "end effector",
    "loss_gradient": "loss and gradient",
}
CAPTION = (
    "One thread, data in cache; the best of each of {rounds} interleaved rounds, medians over the "
    "rounds, ratios within a round. tiles: arrays of tiles of 8 samples in place, sine and cosine "
    "included or, where the row says so, stored; what depends on λ or π alone once per call. "
    "samples: sample-major arrays in and out, zeros included, with how many times longer Pinocchio "
    "C++ takes. Called in a loop from C on {samples} samples, on fewer where the outputs would "
    "leave the cache. Peers: ns and how many times our tiles, the same states one at a time, "
    "Pinocchio C++ in a C++ loop, the others from a Python loop; NumPy starts from a stored Y. "
    "ops: additions, products, divisions and one per sine or cosine, per sample. FMA: ops per time "
    "over the measured limit of one core at the level's width, a multiply-add counted as two."
)


def table(report: Report) -> Table:
    """One line per kernel and level, tiles and samples side by side."""
    title = f"{report.robot}: ns per sample, {report.processor}"
    caption = CAPTION.format(rounds=report.rounds, samples=report.samples)
    columns = ("kernel", "level", "ops", "tiles", "FMA", "samples")
    shown = Table(*columns, title=title, caption=caption)
    for label in report.peers:
        shown.add_column(label)
    for column in shown.columns[2:]:
        column.justify = "right"
    pairs = _pairs(report)
    for k, (tiles, batch) in enumerate(pairs):
        row = _row(tiles, batch)
        cells = [_times(row, label, "{ns:.0f} ({times})") for label in report.peers]
        last = k == len(pairs) - 1 or _row(*pairs[k + 1]).level != row.level
        shown.add_row(
            _label(row),
            row.level,
            str(row.operations),
            f"{tiles.ns:.1f}" if tiles else "",
            f"{100 * row.share:.0f} %",
            _with_ratio(batch),
            *cells,
            end_section=last,
        )
    return shown


def footnotes(report: Report) -> list[str]:
    """Limits, requirements, algorithms of the peers and missing peers, one line each."""
    limits = ", ".join(f"{level} {value:.1f}" for level, value in report.limits.items())
    lines = [
        f"limit of one core, GFLOP/s: {limits} (with {report.timer}); clock {report.clock:.2f} GHz"
    ]
    cycles = {
        item.algorithm: item.ns * report.clock
        for row in report.rows
        for label, item in row.peers.items()
        if label == "Pinocchio C++"
    }
    if cycles:
        listed = ", ".join(f"{name} {count:.0f}" for name, count in cycles.items())
        lines.append(f"cycles of one call of Pinocchio C++: {listed}")
    for label, detail in report.peers.items():
        used = {row.kernel: row.peers[label] for row in report.rows if label in row.peers}
        names = ", ".join(f"{kernel}: {item.algorithm}" for kernel, item in used.items())
        lines += [f"{label}: {names}", f"    {detail}"]
    lines += [f"{label} did not run: {why}." for label, why in report.missing.items()]
    for bar in report.bars:
        lines.append(f"{'met   ' if bar.met else 'MISSED'} {bar.text}: {bar.measured:.3g}")
    return lines


def markdown(report: Report) -> str:
    """Markdown table: ns per sample, and how many times longer the peers take."""
    labels = [label for label in report.peers if label != "NumPy"]
    head = ("kernel", "level", "tiles, ns", "limit", "samples, ns", *labels)
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for tiles, batch in _pairs(report):
        row = _row(tiles, batch)
        cells = [
            _label(row),
            row.level,
            f"{tiles.ns:.1f}" if tiles else "",
            f"{100 * row.share:.0f} %",
            f"{batch.ns:.1f}" if batch else "",
            *(_times(row, label, "{times}") for label in labels),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _pairs(report: Report) -> list[tuple[Row | None, Row | None]]:
    """Rows of the same kernel and level: tiles, plain or stored, and samples beside the plain."""
    lines: dict[tuple[str, str, bool], list[Row | None]] = {}
    for row in report.rows:
        key = (row.kernel, row.level, row.layout == "stored")
        lines.setdefault(key, [None, None])[row.layout == "batch"] = row
    return [(tiles, batch) for tiles, batch in lines.values()]


def _row(tiles: Row | None, batch: Row | None) -> Row:
    row = tiles or batch
    assert row is not None  # noqa: S101  a line exists because a row does
    return row


def _label(row: Row) -> str:
    label = LABELS.get(row.kernel, row.kernel)
    return f"{label}, sine and cosine stored" if row.layout == "stored" else label


def _times(row: Row, label: str, form: str) -> str:
    item = row.peers.get(label)
    if item is None:
        return ""
    return form.format(ns=item.ns, times=f"{item.ratio:.{1 if item.ratio < 10 else 0}f}×")


def _with_ratio(row: Row | None) -> str:
    if row is None:
        return ""
    times = _times(row, "Pinocchio C++", " ({times})")
    return f"{row.ns:.1f}{times}"
