"""Candidates whose work pose errors have done: what scans' errors have of their pattern is handed over to them.

Where every scan is off as a candidate would have it, the model without it fits as well, but for poses that are all
wrong. The way from there to the candidate is long and flat, for the spread of the errors only shrinks as they do. So
candidates are fitted from its other end, too: from the amplitude that errors follow, and the errors that it leaves.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.data.frames import bending
from cosim.discrepancy.data.sample import same_beams
from cosim.discrepancy.gate import Direction
from cosim.discrepancy.inference.fit import POSE_FLOOR, Fitted, Fitter, all_free
from cosim.discrepancy.pose_patterns import PosePatterns
from cosim.discrepancy.ranking import STEPS, Ranked, entangled, pose_gain
from cosim.discrepancy.settling import Trace, leans
from sensors.effects.base import BeamEffect, Effect

_WORTH, _NEARLY = 0.1, 0.5  # shares of pose errors: that a candidate must make up for, and of what the best does


def handed_over(
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
        starts: all directions, by effect.
        trace: traces frames anew.
        settled: places of effects that have been fitted before.
    """
    if not leans(fitted.pose, np.zeros_like(fitted.pose)):
        return list(ranked)
    patterns = PosePatterns(fitter, fitted)
    begun = dict[str, _Begun]()
    for one in ranked:
        bends = isinstance(one.fitted.effects[one.place], BeamEffect) and one.place not in settled
        start = _begun(patterns, fitted, starts[one.effect]) if bends else None
        if start is not None:
            begun[one.effect] = start
    least = max(_WORTH, _NEARLY * max((start.share for start in begun.values()), default=0.0))
    found = []
    for one in ranked:
        start = begun.get(one.effect)
        if start is None or start.share < least:
            found.append(one)
        else:
            found.append(_better(one, fitter, fitted, start, starts[one.effect][0], trace, settled))
    return found


@dataclass(frozen=True, eq=False)
class _Begun:
    """A candidate as strong as pose errors follow it.

    Attributes:
        effect, place: the effect, and where it stands if it is there already.
        pose: (scans, 6) the errors that it leaves.
        share: of the errors that it makes up for.
    """

    effect: Effect
    place: int | None
    pose: np.ndarray
    share: float


def _begun(patterns: PosePatterns, fitted: Fitted, directions: Sequence[Direction]) -> _Begun | None:
    """None of a candidate that pose errors do not follow at all."""
    of_amplitude: dict[str, tuple[Direction, np.ndarray]] = {}
    for direction in directions:
        pattern = patterns.pattern(direction) if direction.amplitude else None
        if pattern is not None and direction.start is not None:
            of_amplitude.setdefault(direction.amplitude, (direction, pattern))
    if not of_amplitude:
        return None
    columns = np.stack([(pattern / fitted.pose_sigma).ravel() for _, pattern in of_amplitude.values()], 1)
    errors = (fitted.pose / fitted.pose_sigma).ravel()
    amplitudes = np.linalg.lstsq(columns, errors, rcond=1e-6)[0]
    left = errors - columns @ amplitudes
    share = 1 - float(left @ left) / float(errors @ errors)
    first = next(iter(of_amplitude.values()))[0]
    effect = first.start
    assert effect is not None  # others have been left out
    off = effect if first.place is not None else type(effect).model_validate(type(effect).neutral or {})
    values = {
        name: getattr(fitted.effects[first.place] if first.place is not None else off, name) + float(amplitude)
        for name, amplitude in zip(of_amplitude, amplitudes, strict=True)
    }
    return _Begun(with_values(effect, values), first.place, left.reshape(fitted.pose.shape) * fitted.pose_sigma, share)


def _better(
    one: Ranked,
    fitter: Fitter,
    fitted: Fitted,
    begun: _Begun,
    start: Direction,
    trace: Trace,
    settled: Collection[int],
) -> Ranked:
    pose = begun.pose
    place = len(fitted.effects) if begun.place is None else begun.place
    effects = (*fitted.effects[:place], begun.effect, *fitted.effects[place + 1 :])
    along = [other for other in entangled(fitter, fitted, start, settled) if other != place]
    free = all_free(effects, [place, *along], fitter.rings)
    sigma = np.maximum(np.sqrt((pose**2).mean(0)), POSE_FLOOR)
    # Slopes do not reach from one end to the other: vehicles stand elsewhere, and far ground is met where it rises.
    anew = Fitter(same_beams(fitter.sample, trace(bending(effects), pose)))
    found = anew.fit(effects, free, pose=pose, pose_sigma=sigma, steps=STEPS)
    keep = ~fitter.sample.edge & ~anew.sample.edge & (anew.sample.compared == fitter.sample.compared)
    gain = float((fitter.sample.share * (found.fit.loglik - fitted.fit.loglik))[keep].sum()) + pose_gain(
        fitter, fitted, found
    )
    delta = 2 * gain - one.parameters * np.log(float(len(fitter.sample)))
    if delta <= one.delta_bic:
        return one
    there_again = fitter.fit(found.effects, free, pose=found.pose, pose_sigma=found.pose_sigma, steps=0)
    return replace(one, fitted=there_again, place=place, delta_bic=float(delta))
