"""Discrepancy loop: compare a sensor model with measurements, diagnose missing effects, add them to the model."""

from cosim.discrepancy.add import Added, add
from cosim.discrepancy.compare import Comparison, compare
from cosim.discrepancy.diagnose import diagnose
from cosim.discrepancy.diagnosis import Diagnosis

__all__ = ["Added", "Comparison", "Diagnosis", "add", "compare", "diagnose"]
