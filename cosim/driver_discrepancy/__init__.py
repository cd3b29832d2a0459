"""The discrepancy loop for driver behaviour: compare trajectories, diagnose, improve."""

from cosim.driver_discrepancy.comparison import TrafficComparison, traffic_compare
from cosim.driver_discrepancy.diagnose import traffic_diagnose
from cosim.driver_discrepancy.diagnosis import TrafficDiagnosis
from cosim.driver_discrepancy.tracks import Tracks, read_tracks, write_tracks

__all__ = [
    "Tracks",
    "TrafficComparison",
    "TrafficDiagnosis",
    "read_tracks",
    "traffic_compare",
    "traffic_diagnose",
    "write_tracks",
]
