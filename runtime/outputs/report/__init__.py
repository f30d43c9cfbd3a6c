"""HTML report of a result folder, and figures of motions, logs and expected accuracy."""

from runtime.outputs.report.report import ReportKind

__all__ = ["ReportKind"]
