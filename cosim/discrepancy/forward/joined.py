"""Replay of effects on the beams of several frames in one array, which is faster than frame by frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import cached_property, reduce
from typing import Any, TypeVar

import numpy as np

from cosim.discrepancy.forward.replay import Expected, FrameReplay, Replayed
from sensors.beams import Beams
from sensors.effects.base import Effect
from sensors.effects.expectation import ExpectationMemo
from sensors.errors import SensorError
from sensors.hits import Hits, Surface
from sensors.rays import Rays
from sensors.scene import Instances
from sensors.shot import Shot
from sensors.world import Traced

_T = TypeVar("_T")


class NeedsOneFrameError(Exception):
    """An effect needs data that differ between frames, such as a world or a time."""


class SampleReplay:
    """Beams of several frames, concatenated.

    Args:
        frames: beams of each frame.
    """

    def __init__(self, frames: Sequence[FrameReplay]) -> None:
        self.frames = tuple(frames)
        self._frame_by_frame: set[frozenset[type[Effect]]] = set()

    def expect(self, effects: tuple[Effect, ...]) -> Expected:
        """Predict the beams from effects, given in the order in which they act.

        Effects that need a frame's world or time are evaluated frame by frame.
        """
        types = frozenset(type(effect) for effect in effects)
        if len(self.frames) > 1 and types not in self._frame_by_frame:
            try:
                return self._together.expect(effects)
            except (NeedsOneFrameError, SensorError):
                self._frame_by_frame.add(types)
        parts = [part.expect(effects) for part in self.frames]
        arrays = {
            name: np.concatenate([getattr(part, name) for part in parts])
            for name in ("along_m", "above_m", "spurious_per_m")
        }
        return Expected(
            _joined([part.of for part in parts]),
            **arrays,
            log_odds_by_reflectance=lambda: np.concatenate([part.log_odds_by_reflectance() for part in parts]),
        )

    @cached_property
    def _together(self) -> _Together:
        return _Together(self.frames)


class _Together(Replayed):
    """Beams of several frames in one array; several shots are cached because fits return to earlier values.

    Raises:
        NeedsOneFrameError: the frames differ in materials or calibration.
    """

    ways = 3

    def __init__(self, frames: Sequence[FrameReplay]) -> None:
        super().__init__()
        if len({(id(frame.table), frame.is_calibrated, frame.measured is None) for frame in frames}) > 1:
            raise NeedsOneFrameError("frames differ in their materials or points")
        sizes = [len(frame.along_m) for frame in frames]
        first, first_instance = (
            np.cumsum([0, *sizes[:-1]]),
            np.cumsum([0, *(len(frame.paint) for frame in frames[:-1])]),
        )
        self._frames, self.frame = frames, np.repeat(np.arange(len(frames)), sizes)
        self.nominal = _joined([frame.nominal for frame in frames])
        self.met, self.paned = _joined([frame.met for frame in frames]), _joined([frame.paned for frame in frames])
        self.solid = _surfaces([frame.solid for frame in frames], first_instance)
        self.pane = _surfaces([frame.pane for frame in frames], first_instance)
        self.pane_beam = np.concatenate([frame.pane_beam + row for frame, row in zip(frames, first, strict=True)])
        self.paint, self.table = np.concatenate([frame.paint for frame in frames]), frames[0].table
        self.is_calibrated = frames[0].is_calibrated
        self.along_m = np.concatenate([frame.along_m for frame in frames])
        sigma_m, sigma_intensity = (
            np.concatenate(each) for each in zip(*(frame.twin_sigmas for frame in frames), strict=True)
        )
        self.twin_sigmas = sigma_m, sigma_intensity
        measured = [frame.measured for frame in frames if frame.measured is not None]
        self.measured = (
            {name: np.concatenate([frame[name] for frame in measured]) for name in measured[0]} if measured else None
        )
        self.egos = [frame.egos[0] for frame in frames]
        self.poses = [frame.poses[0] for frame in frames]

    def _shot_and_memo(self, effects: Sequence[Effect]) -> tuple[Shot, ExpectationMemo]:
        shot, memo = super()._shot_and_memo(effects)
        assert isinstance(shot, _JoinedShot)
        shot.effects = tuple(effects)
        return shot, memo

    def _nominal_shot(self) -> Shot:
        return _JoinedShot(self._frames, self.nominal, self.measured)

    def _build_shot(
        self, beams: Beams, solid: Surface, pane: Surface, moving: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> Shot:
        hits = Hits(beams.rays, np.eye(4), solid, self.pane_beam, pane, self.paint, self.table, moving[1])
        return _JoinedShot(self._frames, beams.rays, self.measured, Traced(hits, moving))


def _joined(parts: Sequence[Any]) -> Any:
    """Concatenate dataclasses of arrays field by field."""
    return type(parts[0])(
        *(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(type(parts[0])))
    )


class _JoinedShot(Shot):
    """Beams of several frames as one shot, in world axes.

    Attributes that belong to one frame (world, camera, time, revolution) raise `NeedsOneFrameError`.

    Attributes:
        effects: effects that deflect the beams.
    """

    effects: tuple[Effect, ...] = ()

    def __init__(
        self,
        frames: Sequence[FrameReplay],
        rays: Rays,
        measured: Mapping[str, np.ndarray] | None,
        traced: Traced | None = None,
    ) -> None:
        self.pattern, self.rays, self.traced, self.measured = frames[0].pattern, rays, traced, measured
        self._kept, self._cache, self._frames = {}, {}, frames
        self.is_texture_known = all(frame.is_texture_known for frame in frames)

    @property
    def is_part(self) -> bool:
        """Whether these beams are only some of traced revolutions: always."""
        return True

    def by_frame(self, compute: Callable[[Shot], _T]) -> list[_T]:
        """Results of a function of the beams of one frame, for each frame."""
        return [compute(frame.shot(self.effects)) for frame in self._frames]

    def joined(self, aside: list[Hits]) -> Hits:
        """Join the hits of additional rays of each frame, as `by_frame` returns them."""
        here, first = self.hits, np.cumsum([0, *(len(hits.paint) for hits in aside[:-1])])
        solid = _surfaces([hits.solid for hits in aside], first)
        return Hits(
            here.rays, here.pose, solid, here.pane_beam[:0], here.pane.take(here.pane_beam[:0]), here.paint, here.table
        )

    @cached_property
    def instances(self) -> Instances:
        """Objects of all frames, one after another; their poses are in world axes."""
        return reduce(Instances.and_then, (frame.instances for frame in self._frames))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise NeedsOneFrameError(name)


def _surfaces(surfaces: Sequence[Surface], first: np.ndarray) -> Surface:
    instance = [
        np.where(surface.instance >= 0, surface.instance.astype(np.int32) + row, surface.instance)
        for surface, row in zip(surfaces, first, strict=True)
    ]
    measured = [surface.measured for surface in surfaces if surface.measured is not None]
    return Surface(
        np.concatenate([surface.range_m for surface in surfaces]),
        np.concatenate([surface.normal_code for surface in surfaces]),
        np.concatenate([surface.material for surface in surfaces]),
        np.concatenate(instance),
        np.concatenate(measured) if measured else None,
    )
