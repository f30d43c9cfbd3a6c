"""HTML report of a result folder, and figures of motions, logs and expected accuracy."""

from runtime.outputs.report.report import REPORT_KINDS, ReportKind, write_report

__all__ = ["REPORT_KINDS", "ReportKind", "write_report"]
