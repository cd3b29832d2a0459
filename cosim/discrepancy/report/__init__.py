"""Pages about comparisons and diagnoses, each one self-contained HTML file."""

from cosim.discrepancy.report.compare_page import format_comparison
from cosim.discrepancy.report.diagnose_page import format_diagnosis, left_words
from cosim.discrepancy.report.explorer_section import Explored

__all__ = ["Explored", "format_comparison", "format_diagnosis", "left_words"]
