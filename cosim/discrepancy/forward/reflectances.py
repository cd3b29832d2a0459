"""Solve for the reflectances with which a sensor gives the mean intensities that were measured.

A twin made from labels contains the mean measured intensity of the ground and of each object as their reflectance. A
sensor changes intensities by range, incidence and laser, compresses them and loses weak returns, so that the predicted
mean differs from the measured one. The reflectances are therefore unknowns, solved for by the secant method on the
logarithms, for each surface. The spread of measured intensities that the sensor does not predict is texture that is not
in the twin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from assets.materials import MaterialTable
from cosim.discrepancy.data.frames import FrameTracer, TracedFrame
from cosim.discrepancy.data.reflectances import FrameReflectances, Reflectances
from cosim.discrepancy.forward.replay import FrameReplay
from sensors.effects.acting import bending, in_order
from sensors.effects.base import Effect
from sensors.effects.expectation import expect
from sensors.hits import STATIC

_FRAMES = 8  # frames from which the reflectances of the static world are computed
_STEPS = 4
_LEAST, _MOST = 0.01, 1.0  # reflectances
_LEAST_MEAN = 1e-3  # intensity; a mean of 0 has no logarithm
_SLOPES = (0.2, 2.0)  # d log(mean intensity) / d log(reflectance): compression to steep detectors
_SMALL_STEP = 1e-4  # change of log(reflectance) from which no slope is computed
_BEAMS = 1000  # of each surface and frame
_FEWEST_BEAMS = 20  # surfaces with fewer keep their reflectance


def solve_reflectances(tracer: FrameTracer, names: Sequence[str]) -> None:
    """Give the tracer the reflectances of a twin made from labels under its sensor; other twins stay as they are.

    Args:
        tracer: of the drive.
        names: frames that will be compared.
    """
    labelled = [name for name in names if tracer.drive[name].has("twin/trust")]
    if not labelled:
        return
    effects = in_order(tracer.sensor.effects)
    bent, chosen = bending(effects), labelled[:: -(-len(labelled) // _FRAMES)]
    world = _Surfaces.of_world([tracer.trace(name, bent) for name in chosen])
    if not world.measured.any():  # no intensities
        return
    table = world.table(world.solved(effects))
    tracer.use_reflectances(Reflectances(table, {}))
    by_frame = {name: _reflectances_of(tracer.trace(name, bent), effects) for name in labelled}
    tracer.use_reflectances(Reflectances(table, by_frame))


def intensity_factors(
    frames: Sequence[TracedFrame], initial: Sequence[Effect], effects: Sequence[Effect]
) -> list[np.ndarray] | None:
    """Factors on the intensities that effects predict, where reflectances are known only from the scans.

    The reflectances of a twin or map that was made from the scans are those with which the initial effects give the
    mean measured intensities. Other effects give the same means with other reflectances.

    Args:
        frames: traced.
        initial: effects for which the reflectances were computed, in the order in which they act.
        effects: of the model, in the same order.

    Returns:
        For each frame (n,) factors by beam; None where the twin was surveyed, or the effects are the same.
    """
    if all(frame.is_surveyed for frame in frames) or tuple(initial) == tuple(effects):
        return None
    of_world = _Surfaces.of_world(frames).factors(initial, effects)
    factors = []
    for frame in frames:
        number = _world_numbers(frame)
        factor = np.where(number >= 0, of_world[number], 1.0)
        if frame.map is None:
            thing = _object_numbers(frame)
            rows = np.flatnonzero(thing >= 0)
            factor[rows] = _Surfaces.of_objects(frame).factors(initial, effects)[thing[rows]]
        factors.append(factor)
    return factors


def _reflectances_of(frame: TracedFrame, effects: Sequence[Effect]) -> FrameReflectances:
    ground, objects = _Surfaces.of_world([frame]), _Surfaces.of_objects(frame)
    paint = objects.solved(effects)
    ground_sd = ground.excess_spread(effects, ground.values)[ground.has_returns]
    return FrameReflectances(
        paint.astype(np.float32),
        float(ground_sd.max(initial=0.0)),
        objects.excess_spread(effects, paint).astype(np.float32),
    )


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """Surfaces with unknown reflectances, and n returns from them.

    Attributes:
        replays: beams of each frame that have these returns.
        number: (n,) int number of the surface of each return.
        measured: (n,) measured intensities.
        values: (s,) initial reflectance of each surface.
        is_world: whether the surfaces are materials of the static world, by row of the table; else paints of objects.
    """

    replays: Sequence[FrameReplay]
    number: np.ndarray
    measured: np.ndarray
    values: np.ndarray
    is_world: bool

    @classmethod
    def of_world(cls, frames: Sequence[TracedFrame]) -> _Surfaces:
        """Materials of the static world."""
        numbers = [_world_numbers(frame) for frame in frames]
        return cls._of(frames, numbers, frames[0].shot.hits.table.column("reflectance").astype(float), True)

    @classmethod
    def of_objects(cls, frame: TracedFrame) -> _Surfaces:
        """Paints of a frame's objects."""
        return cls._of([frame], [_object_numbers(frame)], frame.shot.hits.paint.astype(float), False)

    @classmethod
    def _of(
        cls, frames: Sequence[TracedFrame], numbers: Sequence[np.ndarray], values: np.ndarray, is_world: bool
    ) -> _Surfaces:
        replays, chosen_numbers, measured = [], [], []
        for frame, number in zip(frames, numbers, strict=True):
            observed = frame.observed
            is_used = observed.returned & observed.trusted & np.isfinite(observed.intensity)
            if frame.map is None:  # surfaces of maps have edges everywhere
                is_used &= ~frame.edge
            rows = _evenly_chosen(np.where(is_used, number, -1), _BEAMS)
            replays.append(FrameReplay(frame, rows))
            chosen_numbers.append(number[rows])
            measured.append(observed.intensity[rows].clip(0, 1).astype(float))
        return cls(replays, np.concatenate(chosen_numbers), np.concatenate(measured), values, is_world)

    @property
    def has_returns(self) -> np.ndarray:
        """(s,) bool surfaces with enough returns."""
        return np.bincount(self.number, minlength=len(self.values)) >= _FEWEST_BEAMS

    def solved(self, effects: Sequence[Effect]) -> np.ndarray:
        """Reflectances (s,) with which effects give the mean measured intensities; initial ones without returns."""
        target, level = self._log_means(self.measured), np.log(np.clip(self.values, _LEAST, _MOST))
        slope, last = np.ones(len(level)), None
        for _ in range(_STEPS):
            reached = self._log_means(self._predicted(effects, np.exp(level))[0])
            if last is not None:
                moved, gained = level - last[0], reached - last[1]
                has_moved = np.abs(moved) > _SMALL_STEP
                slope = np.where(has_moved, np.clip(gained / np.where(has_moved, moved, 1.0), *_SLOPES), slope)
            last = level, reached
            level = np.clip(level + (target - reached) / slope, np.log(_LEAST), np.log(_MOST))
        return np.where(self.has_returns, np.exp(level), self.values)

    def excess_spread(self, effects: Sequence[Effect], values: np.ndarray) -> np.ndarray:
        """Standard deviation (s,) of intensities beyond that of the effects at these reflectances (s,)."""
        mean, sigma = self._predicted(effects, values)
        excess = self._means((self.measured - mean) ** 2 - sigma**2)
        return np.sqrt(np.maximum(excess, 0.0))

    def factors(self, initial: Sequence[Effect], effects: Sequence[Effect]) -> np.ndarray:
        """Ratio (s,) of the mean intensities that two models predict; 1 without enough returns."""
        before, after = (self._means(self._predicted(model, self.values)[0]) for model in (initial, effects))
        is_lit = self.has_returns & (before > _LEAST_MEAN) & (after > _LEAST_MEAN)
        return np.where(is_lit, before / np.where(is_lit, after, 1.0), 1.0)

    def table(self, values: np.ndarray) -> MaterialTable:
        """The materials with these reflectances (s,) by row."""
        table = self.replays[0].table
        return table.updated(
            replace(table.materials[table.names[row]], reflectance=float(values[row]))
            for row in np.flatnonzero(self.has_returns)
        )

    def _predicted(self, effects: Sequence[Effect], values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means and standard deviations (n,) of the intensities at these reflectances (s,)."""
        table = self.table(values) if self.is_world else None
        expected = []
        for replay in self.replays:
            one = replay.with_reflectances(table, None if self.is_world else values)
            expected.append(expect(tuple(effects), one.shot(effects), one.twin_sigmas))
        return (
            np.concatenate([one.intensity for one in expected]),
            np.concatenate([one.intensity_sigma for one in expected]),
        )

    def _means(self, values: np.ndarray) -> np.ndarray:
        """Mean (s,) of values (n,) by surface; 0 without returns."""
        count = np.bincount(self.number, minlength=len(self.values))
        return np.bincount(self.number, values, len(self.values)) / np.maximum(count, 1)

    def _log_means(self, values: np.ndarray) -> np.ndarray:
        return np.log(np.maximum(self._means(values), _LEAST_MEAN))


def _world_numbers(frame: TracedFrame) -> np.ndarray:
    """(n,) int row of the material of the static world that each beam hits; −1 for none, or no surface of the map."""
    solid = frame.shot.hits.solid
    is_surface = solid.instance == STATIC if frame.map is None else frame.surface >= 0
    return np.where(is_surface, solid.material.astype(int), -1)


def _object_numbers(frame: TracedFrame) -> np.ndarray:
    """(n,) int row of the instance whose paint each beam hits; −1 for none."""
    hits = frame.shot.hits
    is_painted = (hits.solid.instance >= 0) & hits.table.column("paint")[hits.solid.material]
    return np.where(is_painted, hits.solid.instance.astype(int), -1)


def _evenly_chosen(number: np.ndarray, most: int) -> np.ndarray:
    """Rows of at most about `most` beams of each surface, by the numbers (n,) of the surfaces; −1 is none."""
    rows = np.flatnonzero(number >= 0)
    rows = rows[np.argsort(number[rows], kind="stable")]
    _, first, count = np.unique(number[rows], return_index=True, return_counts=True)
    rank = np.arange(len(rows)) - np.repeat(first, count)
    return np.sort(rows[rank % np.repeat(-(-count // most), count) == 0])
