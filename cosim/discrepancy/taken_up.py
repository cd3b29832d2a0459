"""Candidates whose work pose errors have done: the turn that all scans share.

Where every scan is off alike, the model without the candidate fits as well, but for poses that are all wrong. The way
from there to the candidate is long and flat, so it is fitted from the other end: from poses that are as they are said,
in frames that were traced so.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cosim.discrepancy.fitting import POSE_FLOOR, Fitted, Fitter, all_free
from cosim.discrepancy.frames import bending
from cosim.discrepancy.gate import Direction
from cosim.discrepancy.ranking import LIKE_POSES, STEPS, Foresight, Ranked, entangled, pose_gain, started
from cosim.discrepancy.sample import same_beams
from cosim.discrepancy.settling import Trace, leans
from sensors.effects.base import BeamEffect

_CLOSE_POSES = 2.0  # times their least spread


def from_said_poses(
    ranked: Sequence[Ranked],
    fitter: Fitter,
    fitted: Fitted,
    starts: Mapping[str, Sequence[Direction]],
    trace: Trace,
    settled: Collection[int],
) -> list[Ranked]:
    """Candidates, those that make what fitted pose errors are by the better of both fits.

    Args:
        ranked: fitted from the pose errors of the model as it stands.
        fitter, fitted: that model.
        starts: directions to start from, by effect.
        trace: traces frames anew.
        settled: places of effects that have been fitted before.
    """
    said = np.zeros_like(fitted.pose)
    if not leans(fitted.pose, said) or max((one.delta_bic for one in ranked), default=0.0) > _most(fitted):
        return list(ranked)
    foresee, near, found = Foresight(fitter, fitted), None, []
    for one in ranked:
        start = max(starts[one.effect], key=foresee.pose_likeness)
        like = isinstance(one.fitted.effects[one.place], BeamEffect) and foresee.pose_likeness(start) > LIKE_POSES
        if like and near is None:
            near = Fitter(same_beams(fitter.sample, trace(bending(fitted.effects), said)))
        found.append(_anew(one, fitter, fitted, near, start, trace, settled) if like and near is not None else one)
    return found


def _most(fitted: Fitted) -> float:
    """Fall of the BIC that poses as they are said can bring: where a candidate brings more, it goes first."""
    return 2 * len(fitted.pose) * float(np.log(np.maximum(fitted.pose_sigma / POSE_FLOOR, 1.0)).sum())


def _anew(
    one: Ranked,
    fitter: Fitter,
    fitted: Fitted,
    near: Fitter,
    start: Direction,
    trace: Trace,
    settled: Collection[int],
) -> Ranked:
    effects, place = started(fitter, fitted, start)
    along = [other for other in entangled(fitter, fitted, start, settled) if other != place]
    free = all_free(effects, [place, *along], fitter.rings)
    sigma = np.minimum(fitted.pose_sigma, _CLOSE_POSES * POSE_FLOOR)
    found = near.fit(effects, free, pose=np.zeros_like(fitted.pose), pose_sigma=sigma, steps=STEPS)
    anew = Fitter(same_beams(fitter.sample, trace(bending(found.effects), found.pose)))
    found = anew.fit(found.effects, free, pose=found.pose, pose_sigma=found.pose_sigma, steps=STEPS)
    keep = ~fitter.sample.edge & ~anew.sample.edge & (anew.sample.compared == fitter.sample.compared)
    weight = fitter.sample.weight / fitter.sample.weight.mean()
    gain = float((weight * (found.fit.loglik - fitted.fit.loglik))[keep].sum()) + pose_gain(fitter, fitted, found)
    delta = 2 * gain - one.parameters * np.log(float(len(weight)))
    if delta <= one.delta_bic:
        return one
    there = fitter.fit(found.effects, free, pose=found.pose, pose_sigma=found.pose_sigma, steps=0)
    return replace(one, fitted=there, place=place, delta_bic=float(delta))
