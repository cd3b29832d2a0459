"""Pages about comparisons and diagnoses, each one self-contained HTML file."""

from cosim.discrepancy.report.compare_page import format_comparison
from cosim.discrepancy.report.diagnose_page import format_diagnosis
from cosim.discrepancy.report.gathered import Gathered
from cosim.discrepancy.report.write import write_page

__all__ = ["Gathered", "format_comparison", "format_diagnosis", "write_page"]
