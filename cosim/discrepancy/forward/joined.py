"""Replays the beams of all frames of a sample at once: one array costs what each frame would cost alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np

from cosim.discrepancy.forward.replay import Expected, FrameReplay, Replayed
from sensors.beams import Beams
from sensors.effects.base import Effect
from sensors.errors import SensorError
from sensors.hits import Hits, Surface
from sensors.rays import Rays
from sensors.returns import Returns
from sensors.shot import Shot
from sensors.world import Traced


class NeedsOneFrameError(Exception):
    """An effect asked for something that each frame has of its own."""


class Replay:
    """Some beams of several frames, one frame after the other.

    Args:
        frames: their beams.
    """

    def __init__(self, frames: Sequence[FrameReplay]) -> None:
        self.frames = tuple(frames)
        self._alone: set[frozenset[type[Effect]]] = set()

    def expect(self, effects: tuple[Effect, ...]) -> Expected:
        """What effects, in the order in which they act, let expect.

        Effects that ask for a frame's world or its time are asked frame by frame.
        """
        kinds = frozenset(type(effect) for effect in effects)
        if len(self.frames) > 1 and kinds not in self._alone:
            try:
                return self._together.expect(effects)
            except (NeedsOneFrameError, SensorError):
                self._alone.add(kinds)
        found = [one.expect(effects) for one in self.frames]
        return Expected(
            _joined([one.of for one in found]),
            *(
                np.concatenate([getattr(one, name) for one in found])
                for name in ("along_m", "above_m", "stray", "split")
            ),
        )

    @cached_property
    def _together(self) -> _Together:
        return _Together(self.frames)


class _Together(Replayed):
    """The beams of several frames in one array; a few ways are kept, as fits come back to what they moved away from.

    Raises:
        NeedsOneFrameError: the frames differ in more than what they met.
    """

    ways = 3

    def __init__(self, frames: Sequence[FrameReplay]) -> None:
        super().__init__()
        if len({(id(one.table), one.is_calibrated, one.measured is None) for one in frames}) > 1:
            raise NeedsOneFrameError("frames differ in their materials or points")
        sizes = [len(one.along_m) for one in frames]
        first, things = np.cumsum([0, *sizes[:-1]]), np.cumsum([0, *(len(one.paint) for one in frames[:-1])])
        self._frames, self.frame = frames, np.repeat(np.arange(len(frames)), sizes)
        self.nominal = _joined([one.nominal for one in frames])
        self.met, self.paned = _joined([one.met for one in frames]), _joined([one.paned for one in frames])
        self.solid = _surfaces([one.solid for one in frames], things)
        self.pane = _surfaces([one.pane for one in frames], things)
        self.pane_beam = np.concatenate([one.pane_beam + row for one, row in zip(frames, first, strict=True)])
        self.paint, self.table = np.concatenate([one.paint for one in frames]), frames[0].table
        self.is_calibrated = frames[0].is_calibrated
        self.along_m = np.concatenate([one.along_m for one in frames])
        away, bright = (np.concatenate(each) for each in zip(*(one.unsure for one in frames), strict=True))
        self.unsure = away, bright
        told = [one.measured for one in frames if one.measured is not None]
        self.measured = {name: np.concatenate([one[name] for one in told]) for name in told[0]} if told else None
        self.egos = [one.egos[0] for one in frames]
        self.poses = [one.poses[0] for one in frames]

    def _unbent(self) -> Shot:
        return _JoinedShot(self._frames, self.nominal, self.measured)

    def _answered(
        self, beams: Beams, solid: Surface, pane: Surface, moving: tuple[np.ndarray, np.ndarray, np.ndarray]
    ) -> Shot:
        hits = Hits(beams.rays, np.eye(4), solid, self.pane_beam, pane, self.paint, self.table, moving[1])
        return _JoinedShot(self._frames, beams.rays, self.measured, Traced(hits, moving))


def _joined(found: Sequence[Any]) -> Any:
    """Dataclasses of arrays, one after the other."""
    return type(found[0])(
        *(np.concatenate([getattr(one, field.name) for one in found]) for field in fields(type(found[0])))
    )


class _JoinedShot(Shot):
    """Beams of several frames as one shot, in world axes.

    It knows nothing that each frame has of its own: no world, no camera, no time, no revolution.
    """

    def __init__(
        self,
        frames: Sequence[FrameReplay],
        rays: Rays,
        measured: Mapping[str, np.ndarray] | None,
        traced: Traced | None = None,
    ) -> None:
        self.pattern, self.rays, self.traced, self.measured = frames[0].pattern, rays, traced, measured
        self._kept, self._found, self._frames = {}, {}, frames

    def named(self, what: str, returns: Returns) -> np.ndarray:
        """As of one frame."""
        names = np.array([*(name for one in self._frames for name in getattr(one.instances, what)), ""])
        return names[np.where(returns.instance >= 0, returns.instance, -1)]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise NeedsOneFrameError(name)


def _surfaces(found: Sequence[Surface], first: np.ndarray) -> Surface:
    instance = [
        np.where(one.instance >= 0, one.instance.astype(np.int32) + row, one.instance)
        for one, row in zip(found, first, strict=True)
    ]
    return Surface(
        np.concatenate([one.range_m for one in found]),
        np.concatenate([one.normal_code for one in found]),
        np.concatenate([one.material for one in found]),
        np.concatenate(instance),
    )
