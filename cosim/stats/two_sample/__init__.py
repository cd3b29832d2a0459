"""Classifier two-sample test: can a classifier tell patches of two sets of scans apart, where and by what?"""

from cosim.stats.two_sample.result import TwoSample
from cosim.stats.two_sample.run import separate

__all__ = ["TwoSample", "separate"]
