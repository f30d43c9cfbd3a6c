"""Results folder → one HTML file that an engineer reads in a minute; reads files only."""

from runtime.outputs.report.report import write_report

__all__ = ["write_report"]
