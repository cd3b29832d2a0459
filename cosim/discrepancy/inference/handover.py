"""Do errors of poses follow an effect? What they have taken up of one is handed over to it.

Pose errors u of n scans are independent, of a spread of their own on each axis, and of either sign alike. Where an
effect is worth A of them by amplitude, the marginal likelihood with variances estimated anew gains Σ n/2 log v(0)/v(β)
over the axes, v(β) the mean square of u − Aβ. Scans exchanged and their signs drawn give the law of that (permutation
test: Pitman, J. R. Stat. Soc. Suppl. 1937), whatever the law of the errors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.random_effects import Estimate
from cosim.discrepancy.inference.score_test import Group, Tested


def handed_over(
    fitter: Fitter, fitted: Fitted, model: LinearModel, groups: Sequence[Group], rng: np.random.Generator
) -> Iterator[Tested]:
    """Each effect on poses, as strong as pose errors say, and how surely they follow it, beside all other such effects.

    Args:
        fitter, fitted: of the sample, and the model as it stands.
        model: linear about it.
        groups: among which are the effects, amplitude by amplitude.
        rng: for the draws.
    """
    random, by, scans = fitter.random, fitter.settings.screen, len(fitter.sample.names)
    asked = [one for one in groups if one.channel == "pose" and one.start is not None and "range" in one.columns]
    if not asked or not random.has_poses:
        return
    poses = random.poses(fitted.estimate)
    least = np.array(fitter.settings.unsure.least_poses) ** 2
    known = random.informed(fitted.prediction, fitted.evidence)[: poses.size].reshape(poses.shape).mean(0)
    order = rng.permuted(np.tile(np.arange(scans), (by.draws, 1)), axis=1)
    u = np.concatenate([poses[None], poses[order] * rng.choice((-1.0, 1.0), (by.draws, scans, 1))])
    rows = []
    for name in dict.fromkeys(one.name for one in asked):
        mine = list({one.amplitude: one for one in asked if one.name == name}.values())
        each = [model.projected(one.columns)[0][: poses.size, 0].reshape(poses.shape) for one in mine]
        taken = np.stack(each, -1)
        rows.append((mine, taken, *explained(u, taken, least, known)))
    gains = np.stack([gain for *_, gain in rows])
    sizes = (gains - gains[:, 1:].mean(1, keepdims=True)) / np.maximum(gains[:, 1:].std(1, keepdims=True), 1e-12)
    largest = sizes[:, 1:].max(0)
    for (mine, taken, amplitudes, gain), size in zip(rows, sizes[:, 0], strict=True):
        p_value = min(by.looks * float(1 + np.count_nonzero(largest >= size)) / (1 + by.draws), 1.0)
        effect, place, step = mine[0].start, mine[0].place, amplitudes[0]
        assert effect is not None  # asked before
        off = vars(fitted.effects[place]) if place is not None else dict(type(effect).neutral or {})
        values = {one.amplitude: off[one.amplitude] + more for one, more in zip(mine, step, strict=True)}
        left, (u, variance) = poses - taken @ step, (fitted.estimate.u, fitted.estimate.variance)  # poses come first
        wide = np.maximum((left**2).mean(0), least)
        begun = Estimate(np.append(left, u[left.size :]), np.append(wide, variance[len(wide) :]))
        start = with_values(effect, {**off, **values})
        group = Group(effect.name, "pose", {}, len(mine), start=start, place=place, begun=begun)
        yield Tested(group, float(size), p_value, float(gain[0]), step, float("nan"), float("nan"))


def explained(u: np.ndarray, taken: np.ndarray, least: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Likeliest amplitudes (d, k) of effects that poses take up, and what the marginal likelihood (d,) gains by them.

    Args:
        u: (d, scans, 6) pose errors.
        taken: (scans, 6, k) of them, by amplitude.
        least: (6,) variances below which there are none.
        known: (6,) what beams tell of each axis: a start, as likelihoods with variances have several maxima.
    """
    before, found = np.maximum((u**2).mean(1), least), []
    for variance in (before, np.broadcast_to(1 / np.maximum(known, 1e-300), before.shape)):
        amplitudes = np.zeros((len(u), taken.shape[-1]))
        for _ in range(8):  # variances and amplitudes in turn
            across = np.einsum("nak,nal,da->dkl", taken, taken, 1 / variance)
            slope = np.einsum("nak,dna,da->dk", taken, u, 1 / variance)
            amplitudes = np.einsum("dkl,dl->dk", np.linalg.pinv(across, hermitian=True), slope)
            variance = np.maximum(((u - np.einsum("nak,dk->dna", taken, amplitudes)) ** 2).mean(1), least)
        found.append((amplitudes, 0.5 * u.shape[1] * np.log(before / variance).sum(1)))
    (first, gain), (second, other) = found
    return np.where((gain > other)[:, None], first, second), np.maximum(gain, other)
