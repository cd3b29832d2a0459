"""Do errors of poses follow an effect? What they have taken up of one is handed over to it.

Pose errors of the scans, u with a spread of their own on each axis, are independent and of either sign alike. An effect that
moves all beams of a scan, worth A of them by amplitude, explains them where their spread is less beside it: with the
variances estimated anew the marginal likelihood of n scans gains Σ n/2 log v(0)/v(β) over the axes, v(β) the mean square of
u − Aβ. Scans exchanged and with their signs drawn give the law of that (permutation test: Pitman, J. R. Stat. Soc. Suppl.
1937), whatever the law of the errors.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.group import Group
from cosim.discrepancy.inference.linear_model import LinearModel
from cosim.discrepancy.inference.score_test import Tested

_PASSES = 8  # of variances and amplitudes, one after the other


def handed_over(
    fitter: Fitter, fitted: Fitted, model: LinearModel, groups: Sequence[Group], rng: np.random.Generator
) -> list[Tested]:
    """Each effect on poses, as strong as pose errors say, and how surely they follow it.

    Args:
        fitter, fitted: of the sample, and the model as it stands.
        model: linear about it.
        groups: among which are the effects, amplitude by amplitude.
        rng: of the draws.
    """
    random, by = fitter.random, fitter.settings.screen
    rows, scans = random.rows("poses"), len(fitter.sample.names)
    mine: dict[str, list[Group]] = {}
    for one in groups:
        if one.is_effect and one.channel == "pose" and one.amplitude and one.size == 1 and "range" in one.columns:
            mine.setdefault(one.name, []).append(one)
    if rows.stop == rows.start or random.blocks[0].free or not mine:
        return []
    u, least = random.poses(fitted.estimate), random.least_poses
    order = rng.permuted(np.tile(np.arange(scans), (by.draws, 1)), axis=1)
    drawn = u[order] * rng.choice((-1.0, 1.0), (by.draws, scans, 1))
    everything = np.concatenate([u[None], drawn])
    told = []
    for some in mine.values():
        worth = np.stack([model.projected(one.columns)[0][: rows.stop, 0].reshape(scans, -1) for one in some], -1)
        told.append((some, worth, *_explained(everything, worth, least)))
    gains = np.stack([gain for *_, gain in told])
    sizes = (gains - gains[:, 1:].mean(1, keepdims=True)) / np.maximum(gains[:, 1:].std(1, keepdims=True), 1e-12)
    largest = np.sort(sizes[:, 1:].max(0))
    found = []
    for (some, worth, amplitude, gain), size in zip(told, sizes[:, 0], strict=True):
        above = by.draws - np.searchsorted(largest, size, side="left")
        p_value = min(by.looks * (1 + float(above)) / (1 + by.draws), 1.0)
        estimate = random.with_poses(fitted.estimate, u - worth @ amplitude[0])
        effect = some[0].start
        assert effect is not None  # effects have one
        off = vars(fitted.effects[some[0].place]) if some[0].place is not None else dict(type(effect).neutral or {})
        values = {one.amplitude: off[one.amplitude] + step for one, step in zip(some, amplitude[0], strict=True)}
        start = with_values(type(effect).model_validate({**effect.model_dump(), **off}), values)
        group = Group(some[0].name, "pose", {}, len(some), start=start, place=some[0].place, begun=estimate)
        nothing = float("nan")
        found.append(Tested(group, float(size), p_value, float(gain[0]), amplitude[0], nothing, nothing))
    return found


def _explained(u: np.ndarray, worth: np.ndarray, least: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes (d, k) that explain pose errors best, and what the marginal likelihood (d,) gains.

    Args:
        u: (d, scans, 6) pose errors.
        worth: (scans, 6, k) of amplitudes.
        least: (6,) variances below which there is none.
    """
    before = np.maximum((u**2).mean(1), least)
    variance, amplitude = before, np.zeros((len(u), worth.shape[-1]))
    for _ in range(_PASSES):
        known = np.einsum("nak,nal,da->dkl", worth, worth, 1 / variance)
        slope = np.einsum("nak,dna,da->dk", worth, u, 1 / variance)
        amplitude = np.linalg.solve(known + 1e-12 * np.eye(known.shape[-1]) * known.max((1, 2), keepdims=True), slope[..., None])[..., 0]
        left = u - np.einsum("nak,dk->dna", worth, amplitude)
        variance = np.maximum((left**2).mean(1), least)
    return amplitude, 0.5 * u.shape[1] * np.log(before / variance).sum(1)
