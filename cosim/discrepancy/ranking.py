"""Which candidate explains most: each is fitted, and its likelihood compared."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from cosim.discrepancy.candidates import with_values
from cosim.discrepancy.data.frames import bending
from cosim.discrepancy.data.sample import same_beams
from cosim.discrepancy.gate import Direction, Verdict
from cosim.discrepancy.inference.fit import Fitted, Fitter, all_free
from cosim.discrepancy.inference.intervals import stray_weight
from cosim.discrepancy.inference.likelihood import judge
from cosim.discrepancy.inference.pose_errors import independent_share
from cosim.discrepancy.inference.score import Evidence
from cosim.discrepancy.inference.wild_bootstrap import LEVEL
from cosim.discrepancy.kinds import confusable
from cosim.discrepancy.settling import Trace
from sensors.effects.base import BeamEffect, Effect, ScanEffect

_SHORTLIST, _NEARLY = 6, 0.7
_OUTSTANDING = 3
_LIKE_POSES = 0.2
_RETRACED = 3
_ENTANGLED = 0.25  # share of a candidate's information
_STRANGE_SHARE = 3e-3
_MATTERS, _OF_ITS_OWN = 0.1, 0.5
_STARTS = 2
STEPS = 10
ALIKE_BIC = 10.0  # what differs by less cannot be told apart


@dataclass(frozen=True, eq=False)
class Ranked:
    """A candidate, fitted on top of the model as it stands.

    Attributes:
        effect: its name.
        fitted: the model with it.
        place: where it stands among the effects.
        delta_bic: how much the Bayesian information criterion falls; above 0 speaks for it.
        parameters: how many numbers were fitted.
        sampled_bic: the same of the sample's beams as they are, not as what they stand for: beams of rare things are
            taken whole, and tell more than their share in a drive.
        fact_weight: what one fact weighs in `delta_bic`; each return from nowhere is one.
    """

    effect: str
    fitted: Fitted
    place: int
    delta_bic: float
    parameters: int
    sampled_bic: float = -np.inf
    fact_weight: float = 1.0

    def is_like(self, other: Ranked) -> bool:
        """Whether another candidate cannot be told from this one, by what few beams say if it stands by these."""
        if self.delta_bic <= 0:
            return other.sampled_bic > self.sampled_bic - ALIKE_BIC
        return other.delta_bic > self.delta_bic - ALIKE_BIC * self.fact_weight


def shortlist(
    fitter: Fitter, fitted: Fitted, found: Sequence[Direction], verdict: Verdict
) -> dict[str, list[Direction]]:
    """The effects worth fitting, with the directions to start from: the most promising and the most significant.

    Promise is the gain of likelihood that the linearised model foresees. It knows nothing of how far a slope reaches,
    so that losses that were thought impossible promise most of all: of what moves ranges, all that promise nearly
    as much as the best of it are asked, from afar, too, where ranges are far off, and what is most significant in any
    quantity. Nor does it see that scans' pose errors may be all of one kind, so what would make such errors counts as
    well.
    """
    foresee = Foresight(fitter, fitted, fitted.evidence)
    best = _by_promise(foresee, found)
    names = [name for name in list(best)[:_SHORTLIST] if best[name][0][0] > 0] + _nearly(best)
    wide = fitter.roughness(fitted.prediction, fitted.pose)
    if wide > 0:
        names += _nearly(
            _by_promise(Foresight(fitter, fitted, fitter.evidence(fitted.prediction, fitted.pose, wide)), found)
        )
    likeness = {name: max(foresee.pose_likeness(row[1]) for row in rows) for name, rows in best.items()}
    tilting = sorted((name for name in likeness if likeness[name] > _LIKE_POSES), key=lambda name: -likeness[name])
    names = [*names, *_outstanding(verdict), *tilting[:_OUTSTANDING]]
    names = [name for name in dict.fromkeys(names) if name in best]
    return {name: [direction for _, direction in best[name][: _starts(best[name][0][1])]] for name in names}


def _by_promise(foresee: Foresight, found: Sequence[Direction]) -> dict[str, list[tuple[float, Direction]]]:
    """Effects with their directions and what these promise, the most promising first."""
    promise: dict[str, list[tuple[float, Direction]]] = {}
    for direction in found:
        promise.setdefault(direction.effect, []).append((foresee.gain(direction), direction))
    best = {name: sorted(rows, key=lambda row: -row[0]) for name, rows in promise.items()}
    return dict(sorted(best.items(), key=lambda item: -item[1][0][0]))


def _nearly(best: Mapping[str, Sequence[tuple[float, Direction]]]) -> list[str]:
    """Effects that move ranges and promise nearly as much as the best of these."""
    moving = {name: rows[0][0] for name, rows in best.items() if "range" in rows[0][1].column.delta}
    most = max(moving.values(), default=0.0)
    return [name for name, promised in moving.items() if promised > _NEARLY * most]


def _outstanding(verdict: Verdict) -> list[str]:
    """The most significant effects, of all and of each quantity."""
    significant = [one for one in verdict.statistics if one.p_value <= LEVEL]
    overall = list(dict.fromkeys(one.direction.effect for one in significant))[:_OUTSTANDING]
    first = {one.quantity: one.direction.effect for one in reversed(significant)}
    return [*overall, *first.values()]


def look_alikes(ranked: Sequence[Ranked], found: Sequence[Direction], kinds: Sequence[type[Effect]]) -> list[Direction]:
    """Directions of effects that were not fitted, though the best candidate may be mistaken for them.

    Strong effects bend away from what their slopes foresee, and one with more numbers bends along with them.
    """
    best = max(ranked, key=lambda one: one.delta_bic, default=None)
    if best is None:
        return []
    done = {one.effect for one in ranked}
    kind = type(best.fitted.effects[best.place])
    names = {one.name for one in kinds if one.name not in done and confusable(one, kind)}
    return [direction for direction in found if direction.effect in names]


def _starts(best: Direction) -> int:
    """From how many directions to fit: forms with a gain of their own are as strong as they look."""
    return _STARTS if best.gain is None else 1


def fit_candidate(fitter: Fitter, fitted: Fitted, starts: Sequence[Direction], settled: Collection[int] = ()) -> Ranked:
    """The best fit of one effect from several starts.

    Args:
        fitter: of the sample.
        fitted: the model as it stands.
        starts: directions to start from.
        settled: places of effects that have been fitted before: those that could have taken up what the candidate
            does are fitted along, the others stay as they are.
    """
    best: Ranked | None = None
    rows = float(len(fitter.sample))
    along = entangled(fitter, fitted, starts[0], settled)
    before = _refitted(fitter, fitted, along) if along else fitted
    for start in starts:
        effects, place = started(fitter, fitted, start)
        mine = all_free(effects, [place], fitter.rings)
        free = (*mine, *all_free(effects, [one for one in along if one != place], fitter.rings))
        poses = {"pose": fitted.pose, "pose_sigma": fitted.pose_sigma}
        result = fitter.fit(effects, free, **poses, steps=STEPS, near=along, roughly=True)
        count = sum(one.unknown.rings for one in mine)
        price = count * np.log(rows)
        delta = 2 * gain(fitter, before, result) - price
        if best is None or delta > best.delta_bic:
            sampled = 2 * float((result.fit.loglik - before.fit.loglik).sum()) - price
            strays = isinstance(effects[place], ScanEffect)
            weight = min(stray_weight(fitter, fitted), 1.0) if strays else 1.0
            best = Ranked(start.effect, result, place, float(delta), count, sampled, weight)
    assert best is not None  # there is a start
    return best


def entangled(fitter: Fitter, fitted: Fitted, direction: Direction, settled: Collection[int]) -> tuple[int, ...]:
    """Those of the settled effects that make a good part of the changes that a direction makes."""
    rows, information = len(fitter.sample), fitted.evidence.information
    found = []
    for place in settled:
        free = all_free(fitted.effects, [place], fitter.rings)
        present = fitter.columns(fitted.effects, free, fitted.prediction)
        if not present:
            continue  # a rounding, of which no slope tells
        for quantity in direction.column.delta:
            own = direction.column.matrix(quantity, rows)
            basis = sparse.hstack([column.matrix(quantity, rows) for column in present], format="csr")
            if quantity not in information or not basis.nnz:
                continue
            weighted = sparse.diags(information[quantity]) @ own
            total = float(own.multiply(weighted).sum())
            matrix, shared = (basis.T @ sparse.diags(information[quantity]) @ basis).toarray(), basis.T @ weighted
            matrix += np.diag(1e-9 * np.diag(matrix) + 1e-12)
            explained = float((shared.toarray() * np.linalg.solve(matrix, shared.toarray())).sum())
            if total > 0 and explained > _ENTANGLED * total:
                found.append(place)
                break
    return tuple(found)


def _refitted(fitter: Fitter, fitted: Fitted, places: tuple[int, ...]) -> Fitted:
    """The same model with the effects at some places fitted anew: once for all candidates entangled with those."""
    start, again = fitter.again.get(places, (None, fitted))
    if start is fitted:
        return again
    free = all_free(fitted.effects, places, fitter.rings)
    again = fitter.fit(fitted.effects, free, pose=fitted.pose, pose_sigma=fitted.pose_sigma, steps=STEPS, near=places)
    fitter.again[places] = fitted, again
    return again


def gain(fitter: Fitter, before: Fitted, after: Fitted) -> float:
    """Of log-likelihood, by one fit over another."""
    beams = fitter.sample.share @ (after.fit.loglik - before.fit.loglik)
    return float(beams) + pose_gain(fitter, before, after)


def pose_gain(fitter: Fitter, before: Fitted, after: Fitted) -> float:
    """Of the log-likelihood of pose errors: by how much smaller ones suffice.

    Errors that drift from scan to scan are fewer facts than scans: the middle of a drift is no mount that is off.
    What counts is how much those drift that the better model leaves.
    """
    found = after.loglik - before.loglik - float(fitter.sample.share @ (after.fit.loglik - before.fit.loglik))
    return found * independent_share(after.pose / after.pose_sigma) if found > 0 else found


def judged_anew(ranked: Sequence[Ranked], fitter: Fitter, fitted: Fitted, trace: Trace) -> list[Ranked]:
    """Candidates that bend beams, with what bent beams really meet.

    Where many measurements are not where the model stands, bent beams meet other surfaces than the planes that fits
    hold on to, and whatever makes stray returns would look better than the truth. Beams at an edge of either world
    are left out, for all candidates alike.
    """
    odd = fitter.sample.returned & fitter.sample.compared & (fitted.fit.matched < 0.5)
    strange = fitter.sample.weight @ odd
    tilting = [one for one in ranked if isinstance(one.fitted.effects[one.place], BeamEffect)][:_RETRACED]
    if strange < _STRANGE_SHARE * fitter.sample.weight.sum() or not tilting:
        return list(ranked)
    weight, keep = fitter.sample.share, ~fitter.sample.edge
    rows = {one.effect: one.fitted.fit.loglik for one in ranked}
    for one in tilting:
        beams = bending(one.fitted.effects)
        anew = Fitter(same_beams(fitter.sample, trace(beams, one.fitted.pose)))
        # The pose errors' own share is small beside what other surfaces change.
        prediction = anew.sample.predict(one.fitted.effects)
        rows[one.effect] = judge(anew.sample, prediction, shift=anew.shift(one.fitted.pose, prediction)).loglik
        keep &= ~anew.sample.edge & (anew.sample.compared == fitter.sample.compared)
    found = []
    for one in ranked:
        gained = float((weight * (rows[one.effect] - fitted.fit.loglik))[keep].sum())
        pose = pose_gain(fitter, fitted, one.fitted)
        delta = 2 * (gained + pose) - one.parameters * np.log(float(len(weight)))
        found.append(replace(one, delta_bic=float(delta)))
    return found


def simpler_first(ranked: Sequence[Ranked], fitter: Fitter, starts: Mapping[str, Sequence[Direction]]) -> list[Ranked]:
    """Candidates with those ahead that the best one would take up part of, though it cannot make up for them.

    One number a laser bends to whatever else is missing. Where a candidate of fewer numbers, which it is entangled
    with, still gains most of what it gains alone once the best one is there, both are missing; alone, the one of many
    numbers would end beside its true values. The simpler one counts for what both gain together.
    """
    if not ranked:
        return []
    best, found = max(ranked, key=lambda one: one.delta_bic), []
    if all(free.unknown.rings == 1 for free in best.fitted.free_of(best.place)):
        return list(ranked)
    for one in ranked:
        simpler = one.parameters < best.parameters and one.delta_bic > max(_MATTERS * best.delta_bic, 0.0)
        if simpler and entangled(fitter, best.fitted, starts[one.effect][0], [best.place]):
            both = fit_candidate(fitter, best.fitted, starts[one.effect], [best.place])
            if both.delta_bic > _OF_ITS_OWN * one.delta_bic:
                one = replace(one, delta_bic=best.delta_bic + both.delta_bic)
        found.append(one)
    return found


class Foresight:
    """Gains that the linearised model foresees, pose errors in the background as likely as their spread says."""

    def __init__(self, fitter: Fitter, fitted: Fitted, evidence: Evidence) -> None:
        self._evidence, self._rows = evidence, len(fitter.sample)
        self._precision = fitter.precision(fitted.pose_sigma)
        self._pose = fitted.pose.ravel()[: len(self._precision)]
        poses = fitter.slopes(fitted.pose, fitted.prediction)
        self._weighted = (poses.T @ sparse.diags(evidence.information["range"])).tocsr()
        known = np.asarray((self._weighted @ poses).todense())
        self._known = known + np.diag(1e-9 * np.diag(known) + 1e-12)
        self._block = np.linalg.inv(known + np.diag(self._precision))
        slope = poses.T @ evidence.score["range"]
        self._slope = self._block @ (slope - self._precision * self._pose)

    def pose_likeness(self, direction: Direction) -> float:
        """Share of the scans' fitted pose errors that one amplitude of a direction would make, 0–1."""
        column = direction.column
        if column.rings > 1 or "range" not in column.delta:
            return 0.0
        pattern = np.asarray((self._weighted @ column.matrix("range", self._rows)).todense()).ravel()
        pose = self._pose
        made = float(pattern @ np.linalg.solve(self._known, pattern))
        shown = float(pose @ self._known @ pose)
        return float(pattern @ pose) ** 2 / (made * shown) if made > 0 and shown > 0 else 0.0

    def gain(self, direction: Direction) -> float:
        """Of the log-likelihood, by the best step along a direction."""
        if direction.gain is not None:
            return float(direction.gain.sum())
        column, evidence = direction.column, self._evidence
        matrix, slope = np.zeros((column.rings, column.rings)), np.zeros(column.rings)
        for quantity in column.delta:
            if quantity not in evidence.score:
                continue
            part = column.matrix(quantity, self._rows)
            matrix += (part.T @ sparse.diags(evidence.information[quantity]) @ part).toarray()
            slope += part.T @ evidence.score[quantity]
            if quantity == "range":
                shared = (self._weighted @ part).toarray()
                matrix -= shared.T @ self._block @ shared
                slope -= shared.T @ self._slope
        if direction.one_sided and slope[0] < 0:
            return 0.0
        return 0.5 * float(slope @ np.linalg.solve(matrix + np.diag(1e-9 * np.diag(matrix) + 1e-12), slope))


def started(fitter: Fitter, fitted: Fitted, start: Direction) -> tuple[tuple[Effect, ...], int]:
    """Effects with the candidate among them, as strongly as the linearised model foresees."""
    if start.place is not None:
        return fitted.effects, start.place
    effect = start.start
    assert effect is not None  # of a candidate
    if start.amplitude:
        effect = _best_strength(fitter, fitted, start)
    return (*fitted.effects, effect), len(fitted.effects)


def _best_strength(fitter: Fitter, fitted: Fitted, start: Direction) -> Effect:
    """The start or a stronger form of it, whichever is likeliest."""
    assert start.start is not None  # of a candidate
    kind, sample = type(start.start), fitter.sample
    off = (kind.neutral or {})[start.amplitude]
    weak = np.subtract(getattr(start.start, start.amplitude), off)
    best, reached = start.start, -np.inf
    for factor in (1.0, 5.0, 25.0, -1.0, -5.0):
        trial = with_values(start.start, {start.amplitude: off + weak * factor})
        prediction = sample.predict((*fitted.effects, trial))
        shift = fitter.shift(fitted.pose, prediction)
        value = float(sample.weight @ judge(sample, prediction, shift=shift).loglik)
        if value > reached:
            best, reached = trial, value
    return best
