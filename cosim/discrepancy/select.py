"""What to add next: the screen's best candidates are fitted as they are, and compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.candidates import confusable, with_values
from cosim.discrepancy.groups.dependences import depends_on_scans, main_effects, of_covariates, of_noise, of_pairs
from cosim.discrepancy.groups.dependences import of_scans as of_levels
from cosim.discrepancy.groups.effects import effect_groups
from cosim.discrepancy.groups.group import Group
from cosim.discrepancy.groups.phases import of_phases
from cosim.discrepancy.groups.quantization import Lattice, find_lattices
from cosim.discrepancy.inference.comparison import Gain, gain
from cosim.discrepancy.inference.fit import Fitted, Fitter, all_free
from cosim.discrepancy.inference.likelihood import judge
from cosim.discrepancy.inference.score_test import Tested, screen
from cosim.discrepancy.state import Case, Found, Model, State
from cosim.discrepancy.unknown.plug_in import shape_effect
from cosim.discrepancy.unknown.shape import Shape
from cosim.discrepancy.unknown.solve import shape_of
from sensors.effects.base import Effect, NoiseEffect, RoundingEffect

_FEW_NUMBERS = 2
_OF_CHANNELS = {"range": 4}  # candidates of a channel that are fitted on a map made of the scans, 2 of others
_SHAPES = 2  # dependences that are solved a round
_STEPS = 10
_CLEAR = 2.0  # standard errors
_STRENGTHS = (1.0, 5.0, 25.0, -1.0, -5.0, -25.0)


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

    def worth(self, beams: int) -> float:
        """Gain less what its numbers, and the choice of a shape, cost (half the BIC's penalty)."""
        chosen = 2 if self.shape is not None else 0
        return self.gain.value - 0.5 * (self.numbers + chosen) * float(np.log(beams))

    @property
    def is_fact(self) -> bool:
        """Whether other frames cannot deny it: a step of the file, or levels of the very scans that were fitted."""
        return self.lattice is not None or (self.shape is not None and self.shape.covariate == "scan")

    @property
    def of_noise(self) -> bool:
        """Whether it is about spread alone."""
        return isinstance(self.fitted.effects[self.place], NoiseEffect)


def screened(case: Case, state: State) -> list[Tested]:
    """Every group but pairs, tested at once."""
    fitter, fitted = state.view.fitter, state.view.fitted
    rng = np.random.default_rng([case.seed, 1])
    groups: list[Group] = [
        *effect_groups(fitter, fitted, case.kinds, state.model.fitted),
        *of_covariates(fitter, fitted, case.settings),
        *of_levels(fitter, fitted),
        *of_phases(fitter, fitted, case.settings, rng),
        *of_noise(fitter, fitted),
    ]
    if (
        fitter.sample.of_own_map
    ):  # how rough its surfaces are is only estimated, so what spreads depend on tells nothing
        groups = [one for one in groups if one.is_effect or one.channel != "range_variance"]
    return screen(fitter.system(fitted), fitted.estimate, groups, fitter.random.clusters, case.settings, rng)


def screened_pairs(case: Case, state: State) -> list[Tested]:
    """Pairs of covariates, beside the smooth parts of each alone."""
    fitter, fitted = state.view.fitter, state.view.fitted
    rng = np.random.default_rng([case.seed, 2])
    beside, groups = main_effects(fitter, fitted, case.settings), list(of_pairs(fitter, fitted, case.settings))
    return screen(fitter.system(fitted), fitted.estimate, groups, fitter.random.clusters, case.settings, rng, beside)


def roundings(case: Case, state: State) -> list[Candidate]:
    """Steps that measured values stand on and the model's do not: facts of the file."""
    fitter, fitted = state.view.fitter, state.view.fitted
    rng, found = np.random.default_rng([case.seed, 3]), []
    for one in find_lattices(fitter, fitted, case.kinds, rng):
        kept = [place for place, effect in enumerate(fitted.effects) if effect.name != one.effect.name]
        place = next((p for p, effect in enumerate(fitted.effects) if effect.name == one.effect.name), len(kept))
        effects = (*fitted.effects[:place], one.effect, *fitted.effects[place + 1 :])
        model = state.model.replaced(effects, place)
        after = fitter.fit(effects, (), fitted.estimate, steps=3)
        told = Gain.of([np.bincount(fitter.sample.track, one.gain)])
        found.append(Candidate(one.effect.name, model, place, after, told, 1, 1 / case.settings.draws, lattice=one))
    return found


def tiers(state: State, tested: Sequence[Tested]) -> list[list[Tested]]:
    """What is tried first, and what if nothing of that helps.

    On a map made of the scans a number a laser takes up whatever a few numbers would explain on the beams that a laser
    has, so that effects of few numbers go first; what turns out to have been a part of the others is eliminated later.
    """
    if not state.view.fitter.sample.of_own_map:
        return [list(tested)]
    few = [one for one in tested if one.group.is_effect and one.group.size <= _FEW_NUMBERS]
    return [few, list(tested)]


def candidates(case: Case, state: State, tested: Sequence[Tested]) -> list[Candidate]:
    """Effects and shapes among what is significant, fitted, the best first."""
    level = case.settings.level
    sure = [one for one in tested if one.p_value <= level and one.group.name not in state.refused]
    found = [*_effects(case, state, sure), *_shapes(case, state, sure)]
    beams = len(state.view.fitter.sample)
    return sorted(found, key=lambda one: -one.worth(beams))


def chosen(case: Case, state: State, found: Sequence[Candidate]) -> list[Candidate]:
    """Candidates in the order in which they are tried: channels do not compete, but for one thing a round.

    An unknown shape goes first only where it explains clearly more than the best effect, and than that with the best
    further one.
    """
    beams = len(state.view.fitter.sample)
    found = [one for one in found if one.worth(beams) > 0]
    named = [one for one in found if one.shape is None]
    shapes = [one for one in found if one.shape is not None]
    if not named or not shapes:
        return [*named, *shapes]
    if not _same_channel(named[0], shapes[0]) or not _is_clearly_better(state, shapes[0], named[0]):
        return [*named, *shapes]
    case.say(f"asking whether {named[0].name} and one more explain as much as a shape over {shapes[0].shape.covariate}")  # type: ignore[union-attr]
    with_first = replace(state, model=named[0].model, view=replace(state.view, fitted=named[0].fitted))
    further = _effects(
        case,
        with_first,
        [one for one in screened(case, with_first) if one.p_value <= case.settings.level],
        most=1,
    )
    both = named[0].worth(beams) + max((one.worth(beams) for one in further), default=0.0)
    return [*named, *shapes] if both >= shapes[0].worth(beams) else [shapes[0], *named, *shapes[1:]]


def _is_clearly_better(state: State, one: Candidate, other: Candidate) -> bool:
    """Whether one explains more than another does, for what each costs, and chance does not make the difference."""
    fitter = state.view.fitter
    beams = len(fitter.sample)
    apart = one.worth(beams) - other.worth(beams)
    error = gain(fitter, other.fitted, one.fitted).error
    return apart > _CLEAR * error


def also_possible(case: Case, state: State, best: Candidate, found: Sequence[Candidate]) -> tuple[str, ...]:
    """Effects that explain the data as well as the best candidate: the difference of gains is within its error."""
    alike = []
    for one in found:
        if one.name == best.name or one.shape is not None or best.shape is not None or one.lattice or best.lattice:
            continue
        apart = gain(state.view.fitter, one.fitted, best.fitted)
        price = 0.5 * (best.numbers - one.numbers) * float(np.log(len(state.view.fitter.sample)))
        if (
            apart.value - price < case.settings.alike_sigmas * max(apart.error, 1.0)
            and one.gain.value > 0.5 * best.gain.value
        ):
            alike.append(one.name)
    return tuple(dict.fromkeys(alike))


def _same_channel(one: Candidate, other: Candidate) -> bool:
    shape = other.shape
    assert shape is not None  # a shape
    kind = type(one.fitted.effects[one.place])
    channels = {kind.channel, *kind.also}
    return shape.channel in channels or (shape.channel == "range" and "pose" in channels)


def _effects(case: Case, state: State, sure: Sequence[Tested], most: int | None = None) -> list[Candidate]:
    """Those catalogue effects that promise most, fitted from their best starts."""
    best: dict[str, list[Tested]] = {}
    for one in sorted((one for one in sure if one.group.is_effect), key=lambda one: -one.gain):
        best.setdefault(one.group.name, []).append(one)
    if not best:
        return []
    most = case.settings.fitted_candidates if most is None else most
    gains = {name: rows[0].gain for name, rows in best.items()}
    top = max(gains.values())
    names = [name for place, name in enumerate(best) if place < most or gains[name] > case.settings.nearly * top]
    names = names[: 2 * most]
    if state.view.fitter.sample.of_own_map and most > 1:
        names = _first_of_channels(best)
    if most > 1:
        names += list({one.group.name: 0 for one in sure if one.group.is_effect})[:2]
    kinds = {one.name: one for one in case.kinds}
    for name in list(names[:1] if most > 1 else ()):
        names += [other for other in best if name in kinds and other in kinds and confusable(kinds[name], kinds[other])]
    found = []
    names = list(dict.fromkeys(names))
    case.say(f"fitting {', '.join(names)}")
    for name in names:
        found.append(_fitted(case, state, best[name][0]))
    return found


def _first_of_channels(best: dict[str, list[Tested]]) -> list[str]:
    """The first names in each channel, the others' gains aside: residuals of a map are bounded far from it."""
    count: dict[str, int] = {}
    found = []
    for name, rows in best.items():
        channel = rows[0].group.channel
        count[channel] = count.get(channel, 0) + 1
        if count[channel] <= _OF_CHANNELS.get(channel, 2):
            found.append(name)
    return found


def _fitted(case: Case, state: State, tested: Tested) -> Candidate:
    """An effect fitted on top of the model, what was fitted before along with it."""
    fitter, fitted, group = state.view.fitter, state.view.fitted, tested.group
    effects, place = _started(fitter, fitted, group)
    mine = all_free(effects, [place], fitter.rings)
    along = all_free(effects, [one for one in state.model.fitted if one != place], fitter.rings)
    after = fitter.fit(effects, (*mine, *along), fitted.estimate, steps=_STEPS, roughly=True)
    of_noise = isinstance(after.effects[place], NoiseEffect)
    told = gain(fitter, fitted, after, of_noise=of_noise)
    told = told if of_noise else replace(told, value=after.loglik - fitted.loglik)
    numbers = sum(one.unknown.rings for one in mine)
    model = state.model.replaced(after.effects, place)
    return Candidate(group.name, model, place, after, told, numbers, tested.p_value)


def simpler_than(case: Case, state: State, place: int) -> Candidate | None:
    """An effect with fewer numbers that explains as much as one of those that were added, for what it costs."""
    fitter, fitted = state.view.fitter, state.view.fitted
    effect, beams = fitted.effects[place], len(fitter.sample)
    numbers = sum(one.unknown.rings for one in all_free(fitted.effects, [place], fitter.rings))
    less = state.model.without(place, ())
    there = {one.name for one in less.effects}
    alike = [kind for kind in case.kinds if confusable(kind, type(effect)) and kind.name not in there]
    without = fitter.at(less.effects, fitted.estimate)
    reduced = replace(state, model=less, view=replace(state.view, fitted=without))
    found: list[Candidate] = []
    for group in effect_groups(fitter, without, alike, range(len(less.effects))):
        if group.size < numbers and group.name != effect.name:
            one = _fitted(case, reduced, Tested(group, 0.0, 1.0, 0.0, np.zeros(group.size), np.nan, np.nan))
            if one.numbers < numbers:
                found.append(one)
    own = fitted.loglik - 0.5 * numbers * float(np.log(beams))
    best = max(found, key=lambda one: one.fitted.loglik - 0.5 * one.numbers * float(np.log(beams)), default=None)
    if best is None or best.fitted.loglik - 0.5 * best.numbers * float(np.log(beams)) < own:
        return None
    return best


def best_fit(case: Case, state: State, groups: Sequence[Group]) -> Effect | None:
    """The likeliest fit of one effect from several groups of it; None where there are none."""
    starts = [Tested(one, 0.0, 1.0, 0.0, np.zeros(one.size), np.nan, np.nan) for one in groups]
    found = [_fitted(case, state, one) for one in starts]
    best = max(found, key=lambda one: one.fitted.loglik, default=None)
    return None if best is None else best.fitted.effects[best.place]


def _shapes(case: Case, state: State, sure: Sequence[Tested]) -> list[Candidate]:
    """Shapes of the dependences that promise most, in each channel, as plug-ins fitted like any effect."""
    fitter, fitted = state.view.fitter, state.view.fitted
    found: list[Candidate] = []
    for channel in ("range", "intensity", "drop"):
        rows = [one for one in sure if not one.group.is_effect and one.group.channel == channel and one.group.columns]
        if any("scan" in one.group.covariates for one in rows):
            best_other = max(
                (one.gain - 2 * one.group.size for one in rows if not depends_on_scans(one.group.covariates)),
                default=0.0,
            )
            of_scan = next(one for one in rows if "scan" in one.group.covariates)
            rows = [one for one in rows if not depends_on_scans(one.group.covariates)]
            if of_scan.gain - 2 * of_scan.group.size > best_other:
                rows = [of_scan, *rows]
        rows = sorted(rows, key=lambda one: -(one.gain - 2.0 * one.group.size))
        plain = [one for one in rows if len(one.group.covariates) < 2]
        of_two = [one for one in rows if len(one.group.covariates) > 1]
        for one in [*plain[:_SHAPES], *of_two[:_SHAPES]]:
            shape = shape_of(fitter, fitted, one.group, one.p_value)
            candidate = None if shape is None else _with_shape(state, fitter, fitted, shape, one)
            if candidate is not None:
                found.append(candidate)
    return found


def _with_shape(state: State, fitter: Fitter, fitted: Fitted, shape: Shape, tested: Tested) -> Candidate | None:
    effect = shape_effect(shape)
    if any(one.name == effect.name for one in fitted.effects):
        return None
    effects, place = (*fitted.effects, effect), len(fitted.effects)
    mine = all_free(effects, [place], fitter.rings)
    along = all_free(effects, state.model.fitted, fitter.rings)
    after = fitter.fit(effects, (*mine, *along), fitted.estimate, steps=_STEPS)
    told = gain(fitter, fitted, after)
    told = replace(told, value=after.loglik - fitted.loglik)
    numbers = len(mine) if shape.formula is not None else len(shape.y)
    if shape.factor is not None:
        numbers += len(shape.factor.formula.parameters)
    model = state.model.replaced(after.effects, place)
    return Candidate(effect.name, model, place, after, told, numbers, tested.p_value, shape)


def _started(fitter: Fitter, fitted: Fitted, group: Group) -> tuple[tuple[Effect, ...], int]:
    """Effects with the candidate among them, as strongly as is likeliest of a few strengths."""
    effect = group.start
    assert effect is not None  # of a candidate
    if group.place is not None:
        return fitted.effects, group.place
    if not group.amplitude or isinstance(effect, RoundingEffect):
        return (*fitted.effects, effect), len(fitted.effects)
    off = (type(effect).neutral or {})[group.amplitude]
    weak = np.subtract(getattr(effect, group.amplitude), off)
    best, reached = effect, -np.inf
    for factor in _STRENGTHS:
        trial = with_values(effect, {group.amplitude: off + weak * factor})
        prediction = fitter.sample.predict((*fitted.effects, trial))
        value = float(
            fitter.sample.share @ judge(fitter.sample, fitter.random.adjusted(prediction, fitted.estimate)).loglik
        )
        if value > reached:
            best, reached = trial, value
    return (*fitted.effects, best), len(fitted.effects)


def as_found(case: Case, state: State, one: Candidate, found: Sequence[Candidate]) -> Found:
    """A candidate that was accepted."""
    interval = one.lattice.interval if one.lattice is not None else None
    return Found(one.name, one.place, one.p_value, also_possible(case, state, one, found), one.shape, interval)
