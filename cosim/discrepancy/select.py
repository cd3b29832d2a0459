"""What to add next: the screen's best candidates are fitted as they are, and compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.candidates import confusable, with_values
from cosim.discrepancy.groups.dependences import (
    depends_on_scans,
    main_effects,
    of_covariates,
    of_noise,
    of_pairs,
    of_phases,
)
from cosim.discrepancy.groups.dependences import of_scans as of_levels
from cosim.discrepancy.groups.effects import effect_groups
from cosim.discrepancy.groups.quantization import Lattice, find_lattices
from cosim.discrepancy.inference.comparison import Gain, ToldBy, gain, stability
from cosim.discrepancy.inference.fit import Fitted, Fitter, Free, all_free
from cosim.discrepancy.inference.handover import handed_over
from cosim.discrepancy.inference.score_test import Group, Tested, screen
from cosim.discrepancy.state import Case, Found, Model, State
from cosim.discrepancy.unknown.plug_in import shape_effect
from cosim.discrepancy.unknown.shape import Shape
from cosim.discrepancy.unknown.solve import drawn_anew, shape_of
from sensors.effects.base import Effect, NoiseEffect, RoundingEffect


@dataclass(frozen=True, eq=False)
class Candidate:
    """Something that could be added, fitted on top of the model as it stands.

    Attributes:
        name: of the effect.
        model: with it.
        place: where it stands among the effects.
        fitted: to the frames that are fitted.
        gain: over the model as it stands.
        numbers: how many it has.
        p_value: of its group.
        shape: of an unknown one.
        lattice: of a rounding.
        told_by: what tells other frames of it.
    """

    name: str
    model: Model
    place: int
    fitted: Fitted
    gain: Gain
    numbers: int
    p_value: float
    shape: Shape | None = None
    lattice: Lattice | None = None
    told_by: ToldBy = "beams"

    def price(self, beams: float) -> float:
        """Gain that its numbers, and the choice of a shape, must bring (half the BIC's penalty)."""
        chosen = 2 if self.shape is not None else 0
        return 0.5 * (self.numbers + chosen) * float(np.log(beams))

    def worth(self, beams: int) -> float:
        """Gain less its price."""
        return self.gain.value - self.price(beams)

    @property
    def channels(self) -> set[str]:
        """What it changes; what moves beams shows in ranges."""
        kind = type(self.fitted.effects[self.place])
        found = {str(kind.channel), *map(str, kind.also)}
        return found | {"range"} if "pose" in found else found

    @property
    def is_fact(self) -> bool:
        """Whether other frames cannot deny it: a step of the file, or levels of the very scans that were fitted."""
        return self.lattice is not None or (self.shape is not None and self.shape.is_of_scans)


def screened(case: Case, state: State) -> list[Tested]:
    """Every group but pairs, tested at once."""
    fitter, fitted = state.view.fitter, state.view.fitted
    rng = np.random.default_rng([case.seed, 1])
    groups: list[Group] = [
        *effect_groups(fitter, fitted, case.candidates, state.model.fitted),
        *of_covariates(fitter, fitted),
        *of_levels(fitter, fitted),
        *of_phases(fitter, fitted, rng),
        *of_noise(fitter, fitted),
    ]
    if (
        fitter.sample.of_own_map
    ):  # how rough its surfaces are is only estimated, so what spreads depend on tells nothing
        groups = [one for one in groups if one.is_effect or one.channel != "range_variance"]
    model = fitter.system(fitted)
    found = screen(model, fitted.estimate, groups, fitter.random.clusters, case.settings, rng)
    of_poses = handed_over(fitter, fitted, model, groups, rng)
    return sorted([*found, *of_poses], key=lambda one: (one.p_value, -one.value))


def screened_pairs(case: Case, state: State) -> list[Tested]:
    """Pairs of covariates, beside the smooth parts of each alone: a second look at the same data (Bonferroni)."""
    fitter, fitted = state.view.fitter, state.view.fitted
    rng = np.random.default_rng([case.seed, 2])
    beside, groups = main_effects(fitter, fitted), list(of_pairs(fitter, fitted))
    found = screen(fitter.system(fitted), fitted.estimate, groups, fitter.random.clusters, case.settings, rng, beside)
    return [replace(one, p_value=min(case.settings.screen.looks * one.p_value, 1.0)) for one in found]


def roundings(case: Case, state: State) -> list[Candidate]:
    """Steps that measured values stand on and the model's do not: facts of the file."""
    fitter, fitted = state.view.fitter, state.view.fitted
    rng, found = np.random.default_rng([case.seed, 3]), []
    for one in find_lattices(fitter, fitted, case.candidates, rng):
        kept = [place for place, effect in enumerate(fitted.effects) if effect.name != one.effect.name]
        place = next((p for p, effect in enumerate(fitted.effects) if effect.name == one.effect.name), len(kept))
        effects = (*fitted.effects[:place], one.effect, *fitted.effects[place + 1 :])
        model = state.model.replaced(effects, place)
        after = fitter.fit(effects, (), fitted.estimate, steps=3)
        told = Gain.of([np.bincount(fitter.sample.track, one.gain)])
        found.append(
            Candidate(one.effect.name, model, place, after, told, 1, 1 / case.settings.screen.draws, lattice=one)
        )
    return found


def tiers(case: Case, state: State, tested: Sequence[Tested]) -> list[list[Tested]]:
    """What is tried first, and what if nothing of that helps.

    On a map made of the scans a number a laser takes up whatever a few numbers would explain on the beams that a laser
    has, so that effects of few numbers go first; what turns out to have been a part of the others is eliminated later.
    """
    if not state.view.fitter.sample.of_own_map:
        return [list(tested)]
    few = [one for one in tested if one.group.is_effect and one.group.size <= case.settings.pick.few_numbers]
    return [few, list(tested)]


def candidates(case: Case, state: State, tested: Sequence[Tested]) -> list[Candidate]:
    """Effects among what is significant, fitted, the stablest first; of those that are as good, the simplest."""
    beams = len(state.view.fitter.sample)
    found = sorted(_effects(case, state, _significant(case, state, tested)), key=lambda one: -one.worth(beams))
    if not found:
        return []
    found = [found[row] for row in np.argsort(-_stability(case, state, found), kind="stable")]
    first = min([found[0], *_alike(case, state, found)], key=lambda one: one.numbers)
    return [first, *(one for one in found if one is not first)]


def chosen(case: Case, state: State, tested: Sequence[Tested], named: Sequence[Candidate]) -> Iterator[Candidate]:
    """Candidates in the order in which they are tried: channels do not compete, but for one thing a round.

    An unknown shape goes first only where it explains clearly more than the best effect, and than that with the best
    further one. No shape explains more than the dependence that it is drawn from: where even that is less than what the
    best effect explains, it is drawn only once effects have failed.

    Args:
        case, state: of the diagnosis.
        tested: what the screen says.
        named: effects, fitted, the best first.
    """
    beams = len(state.view.fitter.sample)
    named = [one for one in named if one.worth(beams) > 0]
    waiting = _dependences(_significant(case, state, tested), case.settings.pick.shapes)
    if named:
        best = named[0]
        rivals = [one for one in waiting if one.gain > best.worth(beams) and one.group.channel in best.channels]
        waiting = [one for one in waiting if one not in rivals]
        shapes = _shapes(state, rivals)
        clearly = bool(shapes) and _stability(case, state, (shapes[0], best))[0] >= 1 - case.settings.level
        if clearly and not _two_are_enough(case, state, best, shapes[0]):
            yield shapes.pop(0)
        yield from named
        yield from shapes
    yield from _shapes(state, waiting)


def _two_are_enough(case: Case, state: State, best: Candidate, shape: Candidate) -> bool:
    """Whether the best effect and one more explain as much as a shape."""
    beams = len(state.view.fitter.sample)
    case.say(f"asking whether {best.name} and one more explain as much as {shape.name}")
    with_first = replace(state, model=best.model, view=replace(state.view, fitted=best.fitted))
    further = _effects(case, with_first, _significant(case, with_first, screened(case, with_first)), most=1)
    both = best.worth(beams) + max((one.worth(beams) for one in further), default=0.0)
    return both >= shape.worth(beams)


def _significant(case: Case, state: State, tested: Sequence[Tested]) -> list[Tested]:
    """What the screen is sure of and judging frames have not refused."""
    return [one for one in tested if one.p_value <= case.settings.level and one.group.name not in state.refused]


def _stability(case: Case, state: State, found: Sequence[Candidate]) -> np.ndarray:
    """Share (k,) of random halves of the clusters in which each of k candidates is worth most."""
    beams, rng = len(state.view.fitter.sample), np.random.default_rng([case.seed, 4])
    prices = [one.price(beams / 2) for one in found]
    return stability([one.gain for one in found], prices, case.settings.pick.halves, rng)


def _alike(case: Case, state: State, found: Sequence[Candidate]) -> list[Candidate]:
    """Candidates that cannot be told from the first of them: of its channels, and on some halves the best of all."""
    rows = zip(found[1:], _stability(case, state, found)[1:], strict=True)
    return [one for one, won in rows if won > case.settings.level and one.channels & found[0].channels]


def _effects(case: Case, state: State, sure: Sequence[Tested], most: int | None = None) -> list[Candidate]:
    """Those catalogue effects that promise most, fitted from their best starts."""
    best: dict[str, list[Tested]] = {}
    for one in sorted((one for one in sure if one.group.is_effect), key=lambda one: -one.gain):
        best.setdefault(one.group.name, []).append(one)
    if not best:
        return []
    most = case.settings.pick.fitted if most is None else most
    gains = {name: rows[0].gain for name, rows in best.items()}
    top = max(gains.values())
    names = [name for place, name in enumerate(best) if place < most or gains[name] > case.settings.pick.nearly * top]
    names = names[: 2 * most]
    if state.view.fitter.sample.of_own_map and most > 1:
        names = _first_of_channels(case, best)
    if most > 1:
        names += list({one.group.name: 0 for one in sure if one.group.is_effect})[:2]
    kinds = {one.name: one for one in case.candidates}
    for name in list(names[:1] if most > 1 else ()):
        names += [other for other in best if name in kinds and other in kinds and confusable(kinds[name], kinds[other])]
    names = list(dict.fromkeys(names))
    case.say(f"fitting {', '.join(names)}")
    return [_fitted(state, best[name][0].group, best[name][0].p_value) for name in names]


def _first_of_channels(case: Case, best: dict[str, list[Tested]]) -> list[str]:
    """The first names in each channel, the others' gains aside: residuals of a map are bounded far from it."""
    count: dict[str, int] = {}
    found, by = [], case.settings.pick
    for name, rows in best.items():
        channel = rows[0].group.channel
        count[channel] = count.get(channel, 0) + 1
        if count[channel] <= (by.of_ranges if channel == "range" else by.of_others):
            found.append(name)
    return found


def _fitted(state: State, group: Group, p_value: float = 1.0) -> Candidate:
    """An effect fitted on top of the model, what was fitted before along with it."""
    fitter, fitted = state.view.fitter, state.view.fitted
    effects, place = _started(fitter, fitted, group)
    mine, along = _free(state, effects, place)
    start = fitted.estimate if group.begun is None else group.begun
    after = fitter.fit(effects, (*mine, *along), start, steps=fitter.settings.descent.rough_steps, roughly=True)
    of_noise = isinstance(after.effects[place], NoiseEffect)
    told = gain(fitter, fitted, after, "noise" if of_noise else "beams")
    told = told if of_noise else replace(told, value=after.loglik - fitted.loglik - told.of_shape)
    told_by: ToldBy = "noise" if of_noise else "beams" if group.begun is None else "poses"
    numbers = sum(one.unknown.rings for one in mine)
    model = state.model.replaced(after.effects, place)
    return Candidate(group.name, model, place, after, told, numbers, p_value, told_by=told_by)


def simpler_than(case: Case, state: State, place: int) -> Candidate | None:
    """An effect with fewer numbers that explains as much as one of those that were added, for what it costs."""
    fitter, fitted = state.view.fitter, state.view.fitted
    effect, beams = fitted.effects[place], len(fitter.sample)
    numbers = sum(one.unknown.rings for one in all_free(fitted.effects, [place], fitter.rings))
    less = state.model.without(place, ())
    there = {one.name for one in less.effects}
    alike = [kind for kind in case.candidates if confusable(kind, type(effect)) and kind.name not in there]
    without = fitter.at(less.effects, fitted.estimate)
    reduced = replace(state, model=less, view=replace(state.view, fitted=without))
    found: list[Candidate] = []
    for group in effect_groups(fitter, without, alike, range(len(less.effects))):
        if group.size < numbers and group.name != effect.name and _regains(fitter, without, fitted, group):
            found.append(_fitted(reduced, group))

    worth = [one.fitted.loglik - one.price(beams) if one.numbers < numbers else -np.inf for one in found]
    own = fitted.loglik - 0.5 * numbers * float(np.log(beams))
    return found[int(np.argmax(worth))] if max(worth, default=-np.inf) >= own else None


def _regains(fitter: Fitter, without: Fitted, whole: Fitted, group: Group) -> bool:
    """Whether an effect by itself explains much of what another one does."""
    effects, place = _started(fitter, without, group)
    alone = fitter.fit(effects, all_free(effects, [place], fitter.rings), without.estimate, steps=4, roughly=True)
    return alone.loglik - without.loglik > fitter.settings.pick.much * (whole.loglik - without.loglik)


def reshaped(state: State, found: Found) -> tuple[Shape | None, Candidate | None] | None:
    """An unknown dependence drawn anew, now that everything else is known, with whom it was first drawn.

    Returns:
        The shape, with the formula as it stands, and the candidate that a better formula makes, if one does;
        None where it cannot be drawn. The shape is gone (None) where what is drawn now is not what was found.
    """
    fitter, fitted = state.view.fitter, state.view.fitted
    place = state.model.place_of(found.effect)
    if place is None or found.shape is None:
        return None
    less = state.model.without(place, ())
    without = fitter.at(less.effects, fitted.estimate)
    drawn = drawn_anew(fitter, without, found.shape)
    if drawn is None or drawn.covariates != found.shape.covariates:
        return None
    reduced = replace(state, model=less, view=replace(state.view, fitted=without))
    one = _with_shape(reduced, drawn, found.p_value)
    kept = replace(drawn, formula=found.shape.formula, factor=found.shape.factor)
    beams = len(fitter.sample)
    if one is not None and one.worth(beams) > 0 and one.fitted.loglik - fitted.loglik >= float(np.log(beams)):
        return drawn, one
    last = kept.refitted(fitted.effects[place].model_dump(), {})
    if last.formula is not None and last.formula.r2 <= 0:
        return None, None
    return kept, None


def best_fit(state: State, groups: Sequence[Group]) -> Effect | None:
    """The likeliest fit of one effect from several groups of it; None where there are none."""
    best = max((_fitted(state, one) for one in groups), key=lambda one: one.fitted.loglik, default=None)
    return None if best is None else best.fitted.effects[best.place]


def _dependences(sure: Sequence[Tested], most: int) -> list[Tested]:
    """Those dependences that promise most, of each channel: at most so many on one covariate, and as many on two."""
    found: list[Tested] = []
    for channel in ("range", "intensity", "drop"):
        rows = [one for one in sure if not one.group.is_effect and one.group.channel == channel and one.group.columns]
        if any("scan" in one.group.covariates for one in rows):
            of_scan = next(one for one in rows if "scan" in one.group.covariates)
            rows = [one for one in rows if not depends_on_scans(one.group.covariates)]
            if of_scan.gain - 2 * of_scan.group.size > max(
                (one.gain - 2 * one.group.size for one in rows), default=0.0
            ):
                rows = [of_scan, *rows]
        rows = sorted(rows, key=lambda one: -(one.gain - 2.0 * one.group.size))
        plain = [one for one in rows if len(one.group.covariates) < 2]
        of_two = [one for one in rows if len(one.group.covariates) > 1]
        found += [*plain[:most], *of_two[:most]]
    return found


def _shapes(state: State, dependences: Sequence[Tested]) -> list[Candidate]:
    """Shapes of dependences that are worth their numbers, as plug-ins fitted like any effect, the best first."""
    fitter, fitted = state.view.fitter, state.view.fitted
    drawn = ((shape_of(fitter, fitted, one.group, one.p_value), one.p_value) for one in dependences)
    found = (_with_shape(state, shape, p_value) for shape, p_value in drawn if shape is not None)
    beams = len(fitter.sample)
    return sorted((one for one in found if one is not None and one.worth(beams) > 0), key=lambda one: -one.worth(beams))


def _with_shape(state: State, shape: Shape, p_value: float) -> Candidate | None:
    fitter, fitted, effect = state.view.fitter, state.view.fitted, shape_effect(shape)
    if any(one.name == effect.name for one in fitted.effects):
        return None
    effects, place = (*fitted.effects, effect), len(fitted.effects)
    mine, along = _free(state, effects, place)
    after = fitter.fit(effects, (*mine, *along), fitted.estimate, steps=fitter.settings.descent.rough_steps)
    told = gain(fitter, fitted, after)
    told = replace(told, value=after.loglik - fitted.loglik - told.of_shape)
    numbers = len(mine) if shape.formula is not None else len(shape.y)
    if shape.factor is not None:
        numbers += len(shape.factor.formula.parameters)
    model = state.model.replaced(after.effects, place)
    return Candidate(effect.name, model, place, after, told, numbers, p_value, shape)


def _free(state: State, effects: Sequence[Effect], place: int) -> tuple[tuple[Free, ...], tuple[Free, ...]]:
    """What is fitted of an effect that is added, and of those that were fitted before."""
    others, rings = [one for one in state.model.fitted if one != place], state.view.fitter.rings
    return all_free(effects, [place], rings), all_free(effects, others, rings)


def _started(fitter: Fitter, fitted: Fitted, group: Group) -> tuple[tuple[Effect, ...], int]:
    """Effects with the candidate among them, as strongly as is likeliest of a few strengths."""
    effect = group.start
    assert effect is not None  # of a candidate
    if group.place is not None:
        begun = fitted.effects[group.place] if group.begun is None else effect
        return (*fitted.effects[: group.place], begun, *fitted.effects[group.place + 1 :]), group.place
    if not group.amplitude or isinstance(effect, RoundingEffect):
        return (*fitted.effects, effect), len(fitted.effects)
    off = (type(effect).neutral or {})[group.amplitude]
    weak = np.subtract(getattr(effect, group.amplitude), off)
    best, reached = effect, -np.inf
    for factor in fitter.settings.pick.strengths:
        trial = with_values(effect, {group.amplitude: off + weak * factor})
        prediction = fitter.sample.predict((*fitted.effects, trial))
        value = float(fitter.sample.share @ fitter.residuals(prediction, fitted.estimate).loglik)
        if value > reached:
            best, reached = trial, value
    return (*fitted.effects, best), len(fitted.effects)


def as_found(case: Case, state: State, one: Candidate, found: Sequence[Candidate]) -> Found:
    """A candidate that was accepted; of those found with it, the ones that came before have been refused."""
    interval = one.lattice.interval if one.lattice is not None else None
    left = found[found.index(one) :] if one in found else [one]
    alike = tuple(other.name for other in _alike(case, state, left))
    return Found(one.name, one.p_value, alike, one.shape, interval, one.told_by)
