"""What a diagnosis knows, step by step."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cosim.discrepancy.data.frames import FrameTracer, TracedFrame
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.inference.comparison import ToldBy
from cosim.discrepancy.inference.fit import Fitted, Fitter, all_free
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.inference.score_test import Tested
from cosim.discrepancy.sampling.drawing import draw_sample, with_silhouettes
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.unknown.shape import Shape
from sensors.effects.acting import bending, in_order
from sensors.effects.base import Effect
from sensors.effects.lasers import with_rings
from sensors.sensor_model import SensorModel


@dataclass(frozen=True, eq=False)
class Case:
    """What stays the same throughout a diagnosis.

    Attributes:
        sensor: as it was given.
        tracer: of the drive.
        split: which frames are fitted, and which judge.
        candidates: effects that are asked for.
        settings: numbers that decide.
        seed: of samples and signs.
        say: is told what is being done.
        along: names of the sensor's effects that are fitted along from the beginning.
    """

    sensor: SensorModel
    tracer: FrameTracer
    split: Split
    candidates: tuple[type[Effect], ...]
    settings: Settings
    seed: int
    say: Callable[[str], None]
    along: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Found:
    """An effect or an unknown shape that was added.

    Attributes:
        effect: its name.
        p_value: its own, family-wise.
        also_possible: what explains the data as well.
        shape: of an unknown one.
        interval: known beforehand, of what is no parameter of a fit.
        told_by: what tells other frames of it.
    """

    effect: str
    p_value: float
    also_possible: tuple[str, ...] = ()
    shape: Shape | None = None
    interval: dict[str, list[float]] | None = None
    told_by: ToldBy = "beams"

    @property
    def is_fact(self) -> bool:
        """Whether other frames cannot deny it, see `Candidate.is_fact`."""
        return self.interval is not None or (self.shape is not None and self.shape.is_of_scans)


@dataclass(frozen=True, eq=False)
class Model:
    """Effects, and which of them were fitted here."""

    effects: tuple[Effect, ...]
    fitted: tuple[int, ...] = ()

    def place_of(self, name: str) -> int | None:
        """Where an effect of a name stands; None where there is none."""
        return next((place for place, one in enumerate(self.effects) if one.name == name), None)

    def replaced(self, effects: Sequence[Effect], place: int) -> Model:
        """With other effects, one of which is fitted from now on."""
        places = self.fitted if place in self.fitted else (*self.fitted, place)
        return Model(tuple(effects), places)

    def without(self, place: int, given: Sequence[Effect]) -> Model:
        """With an effect as it was given, or gone where it was not."""
        if place < len(given):
            effects = (*self.effects[:place], given[place], *self.effects[place + 1 :])
            return Model(effects, tuple(one for one in self.fitted if one != place))
        effects = (*self.effects[:place], *self.effects[place + 1 :])
        return Model(effects, tuple(one - (one > place) for one in self.fitted if one != place))


@dataclass(frozen=True, eq=False)
class View:
    """Some frames, traced and fitted.

    Attributes:
        names: of the frames.
        frames: traced as effects bent their beams.
        fitter: of a sample of their beams.
        fitted: the model fitted to it.
    """

    names: tuple[str, ...]
    frames: tuple[TracedFrame, ...]
    fitter: Fitter
    fitted: Fitted


@dataclass(frozen=True, eq=False)
class State:
    """Where a diagnosis stands.

    Attributes:
        model: the sensor as it stands.
        view: the frames that are fitted.
        judges: the frames that judge, the model as it stands with nothing but random effects fitted.
        found: what was added, in order.
        ranking: candidates of the first round with their gains.
        screened: what the last screen said.
        refused: names of what did not help on judging frames.
        struck: findings that the untouched segment denied in the end.
    """

    model: Model
    view: View
    judges: View
    found: tuple[Found, ...] = ()
    ranking: list[tuple[str, float, float]] = field(default_factory=list)
    screened: list[Tested] = field(default_factory=list)
    refused: frozenset[str] = frozenset()
    struck: tuple[Found, ...] = ()

    def with_found(self, one: Found) -> State:
        """With a finding more, or with another one of the same name."""
        rest = tuple(other for other in self.found if other.effect != one.effect)
        return replace(self, found=(*rest, one))


def viewed(
    case: Case,
    names: Sequence[str],
    model: Model,
    rows: int,
    before: View | None = None,
    held: Collection[str] = (),
    traced: Sequence[TracedFrame] | None = None,
    *,
    judging: bool = False,
) -> View:
    """Frames traced as a model bends their beams, and the model fitted, until both agree.

    Args:
        case: of the diagnosis.
        names: of the frames.
        model: its fitted effects are free.
        rows: about how many beams of a sample.
        before: frames that may be traced well enough already, and random effects to start from.
        held: names of parameters that stay as they are.
        traced: the frames, if they have been traced as the model bends their beams.
        judging: on a map made of the scans, by its surfaces in those places that take no part in fitting.
    """
    side = judging if judging or set(names) <= set(case.split.fit) else None
    if before is not None:
        frames = before.frames
    else:
        frames = tuple(case.tracer.trace_all(names, bending(model.effects)) if traced is None else traced)
    effects, start = model.effects, None if before is None else before.fitted.estimate
    fitter: Fitter | None = None if before is None else before.fitter
    random = None if fitter is None else fitter.random
    sizes = None if random is None or start is None else spreads(random, start)
    rounds = case.settings.descent.rounds
    for number in range(rounds + 1):
        if fitter is not None and number < rounds and _is_far(fitter, effects):
            frames, fitter = tuple(case.tracer.trace_all(names, bending(effects))), None
        if fitter is None:
            sample = draw_sample(frames, rows, np.random.default_rng([case.seed, rows]), judging=side)
            if sizes is None:
                plain = Fitter(sample.clear_of([one.edge for one in frames]))
                start, random = plain.fit(effects, (), start).estimate, plain.random
                sizes = spreads(random, start)
            fitter = Fitter(with_silhouettes(frames, sample, *sizes))
            start, random = fitter.random.begun_from(random, start), fitter.random
        free = [one for one in all_free(effects, model.fitted, fitter.rings) if one.unknown.name not in held]
        fitted = fitter.fit(effects, free, start)
        effects, start = fitted.effects, fitted.estimate
        sizes = spreads(fitter.random, start)
        if number == rounds or not _is_far(fitter, effects):
            return View(tuple(names), frames, fitter, fitted)
    raise AssertionError("the last round returns")


def fitted_anew(case: Case, model: Model, before: View | None = None, held: Collection[str] = ()) -> View:
    """The frames that are fitted as a model tells them; see `viewed`."""
    return viewed(case, case.split.fit, model, case.settings.rows, before, held)


def judged(case: Case, before: View, model: Model) -> View:
    """The judging frames as a model tells them: traced anew where it bends beams, random effects alone fitted."""
    return viewed(case, before.names, Model(model.effects), case.settings.judging_rows, before)


def given(case: Case) -> tuple[Effect, ...]:
    """The sensor's own effects, in the order in which they act."""
    return with_rings(in_order(case.sensor.effects), case.sensor.pattern.rings)


def _is_far(fitter: Fitter, effects: Sequence[Effect]) -> bool:
    """Whether effects bend beams too far from where they were traced."""
    turned, shifted = fitter.sample.moved(effects)
    return turned > fitter.settings.descent.turned_rad or shifted > fitter.settings.descent.shifted_m


def seen_by(view: View, effects: Sequence[Effect], estimate: Estimate | None = None) -> Fitted:
    """A model on frames that take no part in fitting it: random effects alone are fitted."""
    return view.fitter.fit(effects, (), view.fitted.estimate if estimate is None else estimate)


def spreads(random: RandomEffects, estimate: Estimate) -> tuple[float, float]:
    """How far edges may stand off: shift [m] and turn [rad], so many standard deviations of poses and objects.

    0 both where they are as good as sharp.
    """
    by, poses = random.sample.settings.unsure, random.spread(estimate, "poses")
    shifts = [poses[:3], *(random.spread(estimate, name)[:2] for name in ("objects", "objects_by_scan"))]
    shift_m = by.edge_sigmas * float(np.sqrt(sum(np.max(one, initial=0.0) ** 2 for one in shifts)))
    turn_rad = by.edge_sigmas * float(np.max(poses[3:], initial=0.0))
    if shift_m < by.sharp_m and turn_rad < by.sharp_rad:
        return 0.0, 0.0
    return min(shift_m, by.widest_m), min(turn_rad, by.widest_rad)
