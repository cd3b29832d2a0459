"""The analysis of a drive: its context, frames traced and fitted, and the nuisance parameters of both."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.discrepancy.candidates import candidate_effects
from cosim.discrepancy.data.checks import undetermined_effects
from cosim.discrepancy.data.frames import FrameTracer, TracedFrame
from cosim.discrepancy.data.split import Split, split_drive, split_frames
from cosim.discrepancy.forward.reflectances import solve_reflectances
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.inference.parameters import all_free
from cosim.discrepancy.inference.random_effects import Estimate, RandomEffects
from cosim.discrepancy.sampling.drawing import draw_sample, split_at_edges
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.drives.kitti import Drive
from cosim.drives.twin.surfels import has_surfels
from sensors.effects.acting import bending, in_order
from sensors.effects.base import Effect
from sensors.effects.lasers import with_rings
from sensors.sensor_model import SensorModel, load_sensor

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Context:
    """Inputs and settings that stay the same throughout an analysis.

    Attributes:
        sensor: model as given.
        tracer: of the drive.
        split: frames to fit, and held-out frames.
        candidates: effects to test.
        settings: numeric choices.
        seed: of samples, signs and folds.
        on_progress: called with a message for each step.
        refitted: names of effects of the sensor whose parameters are fitted from the beginning.
    """

    sensor: SensorModel
    tracer: FrameTracer
    split: Split
    candidates: tuple[type[Effect], ...]
    settings: Settings
    seed: int
    on_progress: Callable[[str], None]
    refitted: tuple[str, ...] = ()

    @property
    def initial_effects(self) -> tuple[Effect, ...]:
        """Effects of the sensor as given, in the order in which they act."""
        return with_rings(in_order(self.sensor.effects), self.sensor.pattern.rings)

    def bending(self, effects: Sequence[Effect]) -> tuple[Effect, ...]:
        """Effects with which beams are traced to find out which surfaces they hit.

        Surfaces of a map that was made from the scans are where the initial effects put their points: each point
        belongs to the surface that they give, whatever the true beams are.
        """
        is_own_map = has_surfels(self.tracer.drive.root)
        return bending(in_order(self.initial_effects if is_own_map else effects))


@dataclass(frozen=True, eq=False)
class FittedFrames:
    """Some frames, traced and fitted.

    Attributes:
        names: of the frames.
        frames: traced as the effects bend the beams.
        fitter: of a sample of their beams.
        fitted: model fitted to the sample.
    """

    names: tuple[str, ...]
    frames: tuple[TracedFrame, ...]
    fitter: Fitter
    fitted: Fitted


def context_of(
    drive: Drive,
    sensor: SensorModel | str | Path,
    *,
    frames: Sequence[str] | None = None,
    extra: Sequence[type[Effect]] = (),
    seed: int = 0,
    settings: Settings = DEFAULT,
    refitted: Sequence[str] = (),
    on_progress: Callable[[str], None] = _LOG.debug,
) -> Context:
    """The context of an analysis; arguments as of `diagnose`."""
    model = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
    split = split_for(drive, model, frames, settings)
    types = candidates_for(drive, model, len(split.fit), settings, extra)
    tracer = FrameTracer(drive, model, settings)
    solve_reflectances(tracer, (*split.fit, *split.test))
    return Context(model, tracer, split, types, settings, seed, on_progress, tuple(refitted))


def split_for(drive: Drive, model: SensorModel, frames: Sequence[str] | None, settings: Settings) -> Split:
    """Frames to fit and held-out frames, of the given ones or of the whole drive."""
    if frames is None:
        return split_drive(drive, model.pattern.rings * model.pattern.firings, settings.sampling)
    return split_frames(tuple(frames), settings=settings.sampling)


def candidates_for(
    drive: Drive, model: SensorModel, fitted: int, settings: Settings, extra: Sequence[type[Effect]] = ()
) -> tuple[type[Effect], ...]:
    """Types of the effects that `fitted` frames of a drive can determine; `extra` are those of plug-ins."""
    hidden = undetermined_effects(fitted, has_surfels(drive.root), settings.beams)
    return tuple(kind for kind in candidate_effects(extra, model.pattern.rings) if kind.name not in hidden)


def trace_and_fit(
    context: Context,
    names: Sequence[str],
    effects: Sequence[Effect],
    free: Sequence[int] = (),
    *,
    sample_size: int | None = None,
    warm_start: FittedFrames | None = None,
    fixed_params: Collection[str] = (),
    traced: Sequence[TracedFrame] | None = None,
) -> FittedFrames:
    """Trace frames and fit the model, repeating until both agree.

    Effects that deflect beams change which surface a beam hits. If the fit moves beams further than `settings.descent`
    allows, the frames are traced again, up to `settings.descent.rounds` times.

    Args:
        context: of the analysis.
        names: frames to use.
        effects: of the model, start values.
        free: indices of the effects whose parameters are fitted.
        sample_size: approximate number of beams to sample; by default that of the settings.
        warm_start: earlier result to start from; its traced frames are reused while they are accurate enough.
        fixed_params: names of parameters to keep fixed.
        traced: frames already traced for this model.
    """
    settings = context.settings
    rows = settings.rows if sample_size is None else sample_size
    effects, fitter, start = tuple(effects), None, None
    if warm_start is not None:
        frames, fitter, start = warm_start.frames, warm_start.fitter, warm_start.fitted.estimate
    else:
        frames = tuple(context.tracer.trace_all(names, context.bending(effects)) if traced is None else traced)
    random = None if fitter is None else fitter.random
    tolerance = None if random is None or start is None else edge_tolerance(random, start)
    for number in range(settings.descent.rounds + 1):
        is_last = number == settings.descent.rounds
        if fitter is not None and not is_last and _is_far(fitter, effects):
            frames, fitter = tuple(context.tracer.trace_all(names, context.bending(effects))), None
        if fitter is None:
            sample = draw_sample(frames, rows, np.random.default_rng([context.seed, rows]))
            if tolerance is None:
                clear = Fitter(sample.clear_of([frame.edge for frame in frames]))
                start, random = clear.fit(effects, (), start).estimate, clear.random
                tolerance = edge_tolerance(random, start)
            fitter = Fitter(split_at_edges(frames, sample, *tolerance))
            start, random = fitter.random.warm_start(random, start), fitter.random
        parameters = [one for one in all_free(effects, free, fitter.rings) if one.unknown.name not in fixed_params]
        fitted = fitter.fit(effects, parameters, start, widened=False)
        effects, start = fitted.effects, fitted.estimate
        tolerance = edge_tolerance(fitter.random, start)
        if is_last or not _is_far(fitter, effects):
            return FittedFrames(tuple(names), frames, fitter, fitted)
    raise AssertionError("the last round returns")


def fit_held_out(
    context: Context,
    effects: Sequence[Effect],
    warm_start: FittedFrames | None = None,
    traced: Sequence[TracedFrame] | None = None,
) -> FittedFrames:
    """Trace the held-out frames and fit nothing but their nuisance parameters; see `trace_and_fit`."""
    rows = context.settings.held_out_rows
    return trace_and_fit(context, context.split.test, effects, sample_size=rows, warm_start=warm_start, traced=traced)


def fit_random_effects(on: FittedFrames, effects: Sequence[Effect], estimate: Estimate | None = None) -> Fitted:
    """Fit nothing but the random effects of frames under other effects."""
    return on.fitter.fit(effects, (), on.fitted.estimate if estimate is None else estimate)


def edge_tolerance(random: RandomEffects, estimate: Estimate) -> tuple[float, float]:
    """Shift [m] and turn [rad] by which edges may be off: several standard deviations of poses, objects and map.

    Both are 0 where they are negligible.
    """
    by, poses = random.sample.settings.random_effects, random.spread(estimate, "poses")
    shifts = [poses[:3], *(random.spread(estimate, name)[:2] for name in ("objects", "objects_by_scan", "map"))]
    shift_m = by.edge_sigmas * float(np.sqrt(sum(np.max(part, initial=0.0) ** 2 for part in shifts)))
    turn_rad = by.edge_sigmas * float(np.max(poses[3:], initial=0.0))
    if shift_m < by.sharp_m and turn_rad < by.sharp_rad:
        return 0.0, 0.0
    return min(shift_m, by.widest_m), min(turn_rad, by.widest_rad)


def is_accurate(fitter: Fitter, effects: Sequence[Effect]) -> bool:
    """Whether the frames were traced near enough to where effects bend the beams."""
    return not _is_far(fitter, effects)


def _is_far(fitter: Fitter, effects: Sequence[Effect]) -> bool:
    if fitter.sample.of_own_map:  # see `Context.bending`
        return False
    turned, shifted = fitter.sample.moved(effects)
    return turned > fitter.settings.descent.turned_rad or shifted > fitter.settings.descent.shifted_m
