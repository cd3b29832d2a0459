"""Errors of training and evaluation that are caused by user input."""

from __future__ import annotations

import importlib.util

from cosim.errors import CosimError


class EvaluationError(CosimError):
    """Detections and labels cannot be scored against each other."""


class TrainingError(CosimError):
    """A training configuration, data set or checkpoint cannot be used."""


def demand_torch() -> None:
    """Check that torch is installed.

    Raises:
        TrainingError: it is not installed.
    """
    if importlib.util.find_spec("torch") is None:
        raise TrainingError("this needs torch, which is not installed; run: pip install 'cosim[training]'")
