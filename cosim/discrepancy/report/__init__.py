"""Pages about comparisons and diagnoses, each one self-contained HTML file."""

from cosim.discrepancy.report.compare_page import format_comparison
from cosim.discrepancy.report.diagnose_page import explored_of, format_diagnosis
from cosim.discrepancy.report.explorer_section import Explored

__all__ = ["Explored", "explored_of", "format_comparison", "format_diagnosis"]
