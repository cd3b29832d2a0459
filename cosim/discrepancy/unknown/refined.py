"""A shape followed until it fits: one step from nothing falls short where beams are many deviations off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cosim.discrepancy.data.sample import Prediction
from cosim.discrepancy.inference.columns import Column, Normal
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.likelihood import judge
from cosim.discrepancy.inference.score import Evidence, Quantity

_STEPS = 25
_SETTLED = 0.1  # of a standard error
_MOST_LOST = 0.9


def shape_column(fitted: Fitted, channel: Quantity, row: np.ndarray, bins: int) -> Column:
    """A parameter a bin; intensities and chances of a return change in proportion to themselves."""
    sizes = {"intensity": fitted.prediction.intensity, "drop": fitted.prediction.seen}
    size = sizes.get(channel, np.ones(len(row)))
    return Column({channel: np.where(row >= 0, size, 0.0)}, np.maximum(row, 0), bins)


def solve_shape(
    fitter: Fitter, fitted: Fitted, channel: Quantity, row: np.ndarray, bins: int, steps: int = _STEPS
) -> tuple[np.ndarray, np.ndarray, float]:
    """Values of a shape, their covariance, and the gain of log-likelihood that its first step foresees.

    Pose errors of every scan are fitted along, as likely as their spread says, so that a tilted scan is not taken for
    a dependence on azimuth.

    Args:
        fitter, fitted: the model that the shape is beside.
        channel: what is off.
        row: (n,) bin of every beam; −1 for none.
        bins: how many.
        steps: most Gauss–Newton steps.
    """
    column, y, pose = shape_column(fitted, channel, row, bins), np.zeros(bins), fitted.pose
    evidence, gain, covariance = fitted.evidence, 0.0, np.zeros((bins, bins))
    for number in range(steps):
        step, tilt, covariance, foreseen = _step(fitter, fitted, column, channel, evidence, pose)
        gain = foreseen if number == 0 else gain
        y, pose = y + step, pose + tilt
        if np.all(np.abs(step) < _SETTLED * np.sqrt(np.maximum(np.diag(covariance), 0)) + 1e-12) or number + 1 == steps:
            break
        after = _shaped(fitted.prediction, channel, row, y)
        evidence = Evidence.of(fitter.sample, judge(fitter.sample, after, shift=fitter.shift(pose, fitted.prediction)))
    return y, covariance, gain


def _step(
    fitter: Fitter, fitted: Fitted, column: Column, channel: Quantity, evidence: Evidence, pose: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """A step of the shape, that of pose errors, the covariance of the first, and the gain that it foresees."""
    has_poses = channel == "range" and not fitter.sample.own_axes
    poses = fitter.slopes(pose, fitted.prediction) if has_poses else None
    normal = Normal.of([column], evidence, poses)
    size = normal.parameters
    matrix, right, tilt = normal.matrix[:size, :size], normal.right[:size], np.zeros_like(pose)
    rest = shared = np.zeros(0)
    if poses is not None:
        precision = fitter.precision(fitted.pose_sigma)
        block = np.linalg.inv(normal.matrix[size:, size:] + np.diag(precision))
        shared = block @ normal.matrix[size:, :size]
        rest = block @ (normal.right[size:] - precision * pose.ravel())
        right = right - normal.matrix[:size, size:] @ rest
        matrix = matrix - normal.matrix[:size, size:] @ shared
    covariance = np.linalg.inv(matrix + np.diag(1e-6 * np.diag(matrix) + 1e-12))
    step = covariance @ right
    if poses is not None:
        tilt = (rest - shared @ step).reshape(pose.shape)
    return step, tilt, covariance, 0.5 * float(right @ step)


def _shaped(before: Prediction, channel: Quantity, row: np.ndarray, y: np.ndarray) -> Prediction:
    """A prediction with a shape on top."""
    change = np.where(row >= 0, y[np.maximum(row, 0)], 0.0)
    if channel == "range":
        return replace(before, range_m=before.range_m + change)
    share = np.maximum(1 + change, 1 - _MOST_LOST)
    if channel == "drop":
        seen = np.clip(before.seen * share, 0, 1)
        return replace(before, seen=seen, silent=before.silent + before.seen - seen)
    # Noise of intensities is a share of them.
    return replace(before, intensity=before.intensity * share, intensity_sigma=before.intensity_sigma * share)
