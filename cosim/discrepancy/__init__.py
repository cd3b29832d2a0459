"""Compare with measurements, find the missing effect, add it, watch the error fall."""

from cosim.discrepancy.add import Added, add
from cosim.discrepancy.compare import Comparison, compare
from cosim.discrepancy.diagnose import diagnose
from cosim.discrepancy.diagnosis import Diagnosis

__all__ = ["Added", "Comparison", "Diagnosis", "add", "compare", "diagnose"]
