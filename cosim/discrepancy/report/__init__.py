"""Pages about comparisons and diagnoses, each one self-contained HTML file."""

from cosim.discrepancy.report.compare_page import format_comparison
from cosim.discrepancy.report.diagnose_page import explored_of, format_diagnosis, left_words
from cosim.discrepancy.report.unexplained_section import Explored

__all__ = ["Explored", "explored_of", "format_comparison", "format_diagnosis", "left_words"]
