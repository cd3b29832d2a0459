"""Checks of scans before any pose is known: each states the reason and the option that settles it."""

from cosim.recordings.checks.before import check_survey, missing_scans, raise_findings
from cosim.recordings.checks.survey import Survey, survey_scans

__all__ = ["Survey", "check_survey", "missing_scans", "raise_findings", "survey_scans"]
