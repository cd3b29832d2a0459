"""Checks of a recording before anything is fitted to it: each states the reason and the option that settles it."""

from cosim.recordings.checks.before import check_survey
from cosim.recordings.checks.path import check_path, check_sweep
from cosim.recordings.checks.survey import Survey, survey_scans

__all__ = ["Survey", "check_path", "check_survey", "check_sweep", "survey_scans"]
