"""Replays the beams of all frames of a sample at once: one array costs what each frame would cost alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np

from cosim.discrepancy.data.observation import upwards
from cosim.discrepancy.forward.expectation import Expectation, expect
from cosim.discrepancy.forward.ray_origins import leaving
from cosim.discrepancy.forward.replay import FrameReplay, reached
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams
from sensors.effects.base import BeamEffect, Effect
from sensors.effects.ring_elevation import RingElevation
from sensors.errors import SensorError
from sensors.hits import Hits, Surface
from sensors.rays import Rays
from sensors.returns import Returns
from sensors.shot import Shot
from sensors.world import Traced

_KEPT = 3


class NeedsOneFrameError(Exception):
    """An effect asked for something that each frame has of its own."""


@dataclass(frozen=True, eq=False)
class Expected:
    """What effects let expect of n beams.

    Attributes:
        of: means, spreads and probabilities.
        along_m, above_m: (n,) how far the reported optical centre stands along and above each beam [m].
        stray: (n,) density [1/m] of returns from elsewhere at the measured range; 0 where nothing was measured.
    """

    of: Expectation
    along_m: np.ndarray
    above_m: np.ndarray
    stray: np.ndarray


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
        found = [
            _expected(effects, one.shot(effects), one.unsure, one.looks(effects), one.along_m) for one in self.frames
        ]
        return Expected(
            _joined([one.of for one in found]),
            *(np.concatenate([getattr(one, name) for one in found]) for name in ("along_m", "above_m", "stray")),
        )

    @cached_property
    def _together(self) -> _Together:
        return _Together(self.frames)


class _Together:
    """The beams of several frames in one array.

    Raises:
        NeedsOneFrameError: the frames differ in more than what they met.
    """

    def __init__(self, frames: Sequence[FrameReplay]) -> None:
        if len({(id(one.table), one.is_calibrated, one.measured is None) for one in frames}) > 1:
            raise NeedsOneFrameError("frames differ in their materials or points")
        sizes = [len(one.along_m) for one in frames]
        first, things = np.cumsum([0, *sizes[:-1]]), np.cumsum([0, *(len(one.paint) for one in frames[:-1])])
        self._frames, self._frame = frames, np.repeat(np.arange(len(frames)), sizes)
        self._nominal = _joined([one.nominal for one in frames])
        self._met, self._paned = _joined([one.met for one in frames]), _joined([one.paned for one in frames])
        self._solid = _surfaces([one.solid for one in frames], things)
        self._pane = _surfaces([one.pane for one in frames], things)
        self._pane_beam = np.concatenate([one.pane_beam + row for one, row in zip(frames, first, strict=True)])
        self._paint = np.concatenate([one.paint for one in frames])
        self._along_m = np.concatenate([one.along_m for one in frames])
        self._unsure = tuple(np.concatenate([one.unsure[which] for one in frames]) for which in (0, 1))
        told = [one.measured for one in frames if one.measured is not None]
        self._measured = {name: np.concatenate([one[name] for one in told]) for name in told[0]} if told else None
        self._shots: list[tuple[tuple[Effect, ...], _JoinedShot]] = []
        self._looks: tuple[tuple[Effect, ...], np.ndarray] | None = None

    def expect(self, effects: tuple[Effect, ...]) -> Expected:
        """As of `Replay`."""
        bending = tuple(effect for effect in effects if isinstance(effect, BeamEffect))
        unsure = self._unsure[0], self._unsure[1]
        return _expected(effects, self._shot(bending), unsure, self._looked(effects), self._along_m)

    def _shot(self, bending: tuple[Effect, ...]) -> _JoinedShot:
        """The beams bent; those of the latest few are kept, as fits come back to what they moved away from."""
        kept = next((shot for known, shot in self._shots if known == bending), None)
        if kept is None:
            kept = self._bent(bending)
            self._shots = [*self._shots[1 - _KEPT :], (bending, kept)]
        return kept

    def _looked(self, effects: tuple[Effect, ...]) -> np.ndarray | None:
        """As of `FrameReplay.looks`."""
        if not self._frames[0].is_calibrated:
            return None
        known = tuple(effect for effect in effects if isinstance(effect, RingElevation))
        if self._looks is None or self._looks[0] != known:
            self._looks = known, self._left(known).direction.astype(np.float64)
        return self._looks[1]

    def _left(self, bending: tuple[Effect, ...]) -> Beams:
        before = _JoinedShot(self._frames, self._nominal, self._measured)
        return act_on_beams(
            bending, Beams.nominal(self._nominal), before, Streams(np.random.default_rng(0)), "replayed"
        )

    def _bent(self, bending: tuple[Effect, ...]) -> _JoinedShot:
        beams = self._left(bending)
        egos, poses = [one.ego for one in self._frames], [one.pose for one in self._frames]
        origin, direction, time_s = leaving(beams, egos, poses, self._frame)
        solid = reached(self._solid, self._met.ranges(origin, direction, time_s))
        rows = self._pane_beam
        pane = reached(self._pane, self._paned.ranges(origin[rows], direction[rows], time_s[rows]))
        directions = direction.astype(np.float32)
        table = self._frames[0].table
        hits = Hits(beams.rays, np.eye(4), solid, rows, pane, self._paint, table, directions)
        traced = Traced(hits, (origin, directions, time_s.astype(np.float32)))
        return _JoinedShot(self._frames, beams.rays, self._measured, traced)


def _expected(
    effects: tuple[Effect, ...],
    shot: Shot,
    unsure: tuple[np.ndarray, np.ndarray],
    looks: np.ndarray | None,
    measured_m: np.ndarray,
) -> Expected:
    """What effects let expect of a shot of n beams.

    Args:
        effects: in the order in which they act.
        shot: bent by the beam effects among them.
        unsure: see `expect`.
        looks: see `FrameReplay.looks`.
        measured_m: (n,) along the beams.
    """
    direction = shot.rays.direction
    upward, along, above = shot.kept("optical centres", lambda: _centres(shot.rays))
    found = expect(effects, shot, unsure)
    stray = np.zeros(len(measured_m))
    if looks is not None:
        # Points stand where the unit's calibration has its lasers look, not along the pattern's beams; how far
        # above these follows from the measured range, whatever surface it was.
        ahead = np.einsum("ij,ij->i", looks, direction)
        above = above + (measured_m - along) / ahead * np.einsum("ij,ij->i", looks, upward)
        reach = np.nan_to_num(found.range_m)  # a beam into the sky may return all the same: of a drop, at its range
        along = along + reach * (ahead - 1)
    rows = np.flatnonzero(~np.isnan(measured_m))
    for effect in effects:
        if type(effect).density is not Effect.density:
            stray[rows] += effect.density(rows, measured_m[rows] - along[rows], shot)
    return Expected(found, along, above, stray)


def _centres(rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which way is up (n, 3), and how far optical centres stand along and above the beams, (n,) each [m]."""
    origin, upward = rays.origin.astype(np.float64), upwards(rays.direction)
    return upward, np.einsum("ij,ij->i", origin, rays.direction), np.einsum("ij,ij->i", origin, upward)


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
