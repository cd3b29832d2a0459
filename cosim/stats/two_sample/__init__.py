"""Classifier two-sample test: can a classifier distinguish patches of two sets of scans, where and by what?"""

from cosim.stats.two_sample.result import TwoSample
from cosim.stats.two_sample.run import separate

__all__ = ["TwoSample", "separate"]
