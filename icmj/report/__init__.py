"""The comparison report: figures, sections, page. Built from logs alone."""

from icmj.report.builder import build_report

__all__ = ["build_report"]
