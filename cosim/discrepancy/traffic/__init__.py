"""The discrepancy loop for driver behaviour: compare trajectories, diagnose, improve."""

from cosim.discrepancy.traffic.comparison import TrafficComparison, traffic_compare
from cosim.discrepancy.traffic.diagnose import traffic_diagnose
from cosim.discrepancy.traffic.diagnosis import TrafficDiagnosis
from cosim.discrepancy.traffic.tracks import Tracks, read_tracks, write_tracks

__all__ = [
    "Tracks",
    "TrafficComparison",
    "TrafficDiagnosis",
    "read_tracks",
    "traffic_compare",
    "traffic_diagnose",
    "write_tracks",
]
