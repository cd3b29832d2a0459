"""Pages about comparisons and diagnoses, each one self-contained HTML file."""

from cosim.discrepancy.pages.compare_page import format_comparison
from cosim.discrepancy.pages.diagnose_page import format_diagnosis
from cosim.discrepancy.pages.gathered import Gathered
from cosim.discrepancy.pages.write import write_page

__all__ = ["Gathered", "format_comparison", "format_diagnosis", "write_page"]
