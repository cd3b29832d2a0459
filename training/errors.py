"""Errors of training and evaluation that are the user's to mend."""

from __future__ import annotations

from cosim.errors import CosimError


class EvaluationError(CosimError):
    """Detections and labels cannot be scored against each other."""


class TrainingError(CosimError):
    """A training configuration, data set or checkpoint cannot be used."""
