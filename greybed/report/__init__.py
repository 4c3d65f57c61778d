"""Report: figures, tables, one HTML page."""

from greybed.report.page import render_page

__all__ = ["render_page"]
