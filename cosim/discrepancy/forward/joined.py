"""Replays the beams of all frames of a sample at once: one array costs what each frame would cost alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from cosim.discrepancy.data.observation import upwards
from cosim.discrepancy.forward.expectation import Expectation, expect
from cosim.discrepancy.forward.replay import FrameReplay
from sensors.effects.base import Effect
from sensors.hits import Hits, Surface
from sensors.rays import Rays
from sensors.returns import Returns
from sensors.shot import Shot
from sensors.world import Traced


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
        self._joined: tuple[list[Shot], _JoinedShot] | None = None
        self._alone: set[frozenset[type[Effect]]] = set()

    def expect(self, effects: tuple[Effect, ...]) -> Expected:
        """What effects, in the order in which they act, let expect.

        Effects that ask for a frame's world or its time are asked frame by frame.
        """
        kinds = frozenset(type(effect) for effect in effects)
        if len(self.frames) > 1 and kinds not in self._alone:
            try:
                return self._at_once(effects)
            except NeedsOneFrameError:
                self._alone.add(kinds)
        found = [
            _expected(effects, one.shot(effects), one.unsure, one.looks(effects), one.along_m) for one in self.frames
        ]
        return Expected(
            _joined([one.of for one in found]),
            *(np.concatenate([getattr(one, name) for one in found]) for name in ("along_m", "above_m", "stray")),
        )

    def _at_once(self, effects: tuple[Effect, ...]) -> Expected:
        shots = [one.shot(effects) for one in self.frames]
        looks = [one.looks(effects) for one in self.frames]
        told = [one for one in looks if one is not None]
        if self._joined is None or any(a is not b for a, b in zip(self._joined[0], shots, strict=True)):
            self._joined = shots, _JoinedShot(shots, [one.measured for one in self.frames])
        if len(told) not in (0, len(looks)):
            raise NeedsOneFrameError("only some frames are calibrated")
        unsure = tuple(np.concatenate([one.unsure[which] for one in self.frames]) for which in (0, 1))
        along_m = np.concatenate([one.along_m for one in self.frames])
        joined = np.concatenate(told) if told else None
        return _expected(effects, self._joined[1], (unsure[0], unsure[1]), joined, along_m)


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

    def __init__(self, shots: Sequence[Shot], measured: Sequence[Any]) -> None:
        hits = [shot.hits for shot in shots]
        tables = {id(one.table) for one in hits}
        if len(tables) > 1 or any(one is None for one in measured):
            raise NeedsOneFrameError("frames differ in their materials")
        beams = np.cumsum([0, *(len(shot.rays) for shot in shots[:-1])])
        things = np.cumsum([0, *(len(one.paint) for one in hits[:-1])])
        rays = _joined([shot.rays for shot in shots])
        traced = [shot.traced for shot in shots if shot.traced is not None]
        origin = np.concatenate([one.origin for one in traced])
        direction = np.concatenate([one.direction for one in traced])
        time_s = np.concatenate(
            [np.broadcast_to(one.time_s, len(shot.rays)) for one, shot in zip(traced, shots, strict=True)]
        )
        together = Hits(
            rays,
            np.eye(4),
            _surfaces([one.solid for one in hits], things),
            np.concatenate([one.pane_beam + first for one, first in zip(hits, beams, strict=True)]),
            _surfaces([one.pane for one in hits], things),
            np.concatenate([one.paint for one in hits]),
            hits[0].table,
            direction,
        )
        self.pattern, self.rays = shots[0].pattern, rays
        self.traced = Traced(together, (origin, direction, time_s))
        self.measured = {name: np.concatenate([one[name] for one in measured]) for name in measured[0]}
        self._kept, self._found = {}, {}
        self._names = {
            what: [name for shot in shots for name in getattr(shot.world.instances, what)]  # type: ignore[union-attr]
            for what in ("kinds", "models")
        }

    def named(self, what: str, returns: Returns) -> np.ndarray:
        """As of one frame."""
        names = np.array((*self._names[what], ""))
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
