"""Data of one revolution for effects, in addition to the returns."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from sensors.beams import Beams
from sensors.camera_view import CameraView
from sensors.hits import NOTHING, Hits
from sensors.normals import dot_with_normals
from sensors.pattern import Pattern
from sensors.rays import Rays
from sensors.returns import Returns
from sensors.scene import Instances
from sensors.world import Traced, World

_T = TypeVar("_T")
_KEPT = 8


class Shot:
    """One revolution over one scene.

    Attributes:
        pattern: the beam pattern.
        rays: the n beams as the sensor reports them, LiDAR axes.
        beams: how they really left; None before they are traced, and where only stored hits are at hand.
        traced: what they met; None before they are traced.
        world: shoots new rays; None where only stored hits are at hand.
        camera: what the grayscale camera saw at the pose time; None where no image is at hand.
        frame_time_s: pose time of the frame.
        measured: by name, (n,) measurements of neighbouring beams, if available; see `beside`.
        whole, rows: the whole revolution where these beams are only some of it, and which (n,).
        cache: intermediate results of effects for these beams, for any deflection; shared by shots of the same beams.
        noiseless: returns before the first noise or scan effect; None before these act.
        texture: number of the realisation of all random fields that are fixed to surfaces; 0 is that of the world.
        is_texture_known: whether the measured surfaces have that realisation. Where the world was made from scans, only
            the statistics of its texture are known, and predictions have to average over realisations.
    """

    noiseless: Returns | None = None
    texture: int = 0
    is_texture_known: bool = True

    def __init__(
        self,
        pattern: Pattern,
        rays: Rays,
        *,
        beams: Beams | None = None,
        traced: Traced | None = None,
        world: World | None = None,
        camera: CameraView | None = None,
        frame_time_s: float = 0.0,
        measured: Mapping[str, np.ndarray] | None = None,
        whole: Shot | None = None,
        rows: np.ndarray | None = None,
        cache: dict[str, Any] | None = None,
    ) -> None:
        self.pattern = pattern
        self.rays = rays
        self.beams = beams
        self.traced = traced
        self.world = world
        self.camera = camera
        self.frame_time_s = frame_time_s
        self.measured = measured
        self.whole = whole
        self.rows = rows
        self._kept: dict[str, Any] = {}
        self._cache: dict[str, Any] = {} if cache is None else cache

    def kept(self, name: str, make: Callable[[], _T]) -> _T:
        """Return a cached result of an effect for this revolution, or compute it; only the latest few are kept."""
        if name not in self._kept:
            self._kept[name] = make()
            for oldest in list(self._kept)[:-_KEPT]:
                del self._kept[oldest]
        return self._kept[name]

    def lasting(self, name: str, make: Callable[[], _T]) -> _T:
        """Return a cached result of an effect for these beams, however they were deflected, or compute it."""
        if name not in self._cache:
            self._cache[name] = make()
        return self._cache[name]

    def with_texture(self, number: int) -> Shot:
        """The same beams and hits with another realisation of the fields that are fixed to surfaces."""
        shot = copy.copy(self)
        shot.texture, shot.is_texture_known = number, True
        return shot

    @property
    def is_part(self) -> bool:
        """Whether these beams are only some of a traced revolution."""
        return self.whole is not None and self.rows is not None

    def by_frame(self, compute: Callable[[Shot], _T]) -> list[_T]:
        """Results of a function of the beams of one frame, for each frame; ordinary shots are of one."""
        return [compute(self)]

    def joined(self, aside: list[Hits]) -> Hits:
        """Join the hits of additional rays of each frame, as `by_frame` returns them."""
        return aside[0]

    @property
    def hits(self) -> Hits:
        """Surfaces that the beams hit."""
        return self._traced.hits

    @cached_property
    def solids(self) -> Returns:
        """The solid surface that each beam met, where there is one; intensity its reflectance."""
        return returns_of(self.hits)

    @cached_property
    def panes(self) -> Returns:
        """The pane of glass in front of what each beam met, where there is one; intensity 0."""
        return returns_of(self.hits, "pane")

    @cached_property
    def every_beam(self) -> Returns:
        """One row a beam: the solid surface that it meets, or none; intensity its reflectance."""
        rows = np.arange(len(self.rays))
        if self.traced is None:
            return Returns.spurious(rows, np.full(len(rows), np.inf), np.zeros(len(rows)))
        solid = self.hits.solid
        reflectance = self.hits.reflectance(solid)
        return Returns(
            beam=rows.astype(np.int32),
            range_m=solid.range_m,
            intensity=reflectance,
            reflectance=reflectance,
            normal_code=solid.normal_code,
            material=solid.material,
            instance=solid.instance,
            return_no=np.zeros(len(rows), np.uint8),
        )

    @property
    def instances(self) -> Instances | None:
        """Objects of the world; None without one."""
        return None if self.world is None else self.world.instances

    @property
    def lidar_pose(self) -> np.ndarray:
        """(4, 4) nominal world pose of the LiDAR at the pose time."""
        return self.hits.pose if self.world is None else self.world.pose

    @cached_property
    def block(self) -> np.ndarray:
        """Optical block of each beam, (n,) uint8."""
        return np.array(self.pattern.block, np.uint8)[self.rays.ring]

    def cos_incidence(self, returns: Returns) -> np.ndarray:
        """Cosine between beams and the faces they met, (m,) float32 in 0–1; 1 without a surface."""
        cos = dot_with_normals(returns.normal_code, self._traced.direction.take(returns.beam, axis=0))
        return np.where(returns.instance == NOTHING, np.float32(1), np.minimum(np.abs(cos), np.float32(1)))

    def points_in_world(self, returns: Returns) -> np.ndarray:
        """Points (m, 3) float64 at which the beams hit their surfaces, world axes, before range errors."""
        origin, direction = self._traced.origin[returns.beam], self._traced.direction[returns.beam]
        return origin + direction * returns.range_m.astype(np.float64)[:, None]

    def direction_in_world(self, returns: Returns) -> np.ndarray:
        """True directions of the returns' beams, (m, 3) float32 world axes."""
        return self._traced.direction[returns.beam]

    def time_s(self, returns: Returns) -> np.ndarray:
        """Instants at which the returns' beams saw the world, (m,) float32 from the pose time."""
        return np.broadcast_to(self._traced.time_s, len(self.rays))[returns.beam]

    def beside(self, name: str, returns: Returns, among: Returns | None = None) -> np.ndarray:
        """Measurements (m,) of a neighbour of each beam.

        Args:
            name: `previous_…` of the beam fired before in the ring, `above_…` or `below_…` of the one fired with it in
                the next ring; `…_range` [m] and `…_intensity`, 0 where it did not return, or `…_lost`, 1 where it met a
                surface and did not return.
            returns: of the beams in question.
            among: returns of the neighbours where nothing was measured; by default `returns`.
        """
        if self.measured is not None:
            return self.measured[name][returns.beam]
        whose, what = name.split("_")
        firings, beams = self.pattern.firings, len(self.rays)
        among = returns if among is None else among
        shown = np.zeros(beams, np.float32)
        if what == "lost":
            shown[self.hits.solid.exists] = 1
            shown[among.beam] = 0
        else:
            shown[among.beam] = among.range_m if what == "range" else among.intensity
        other = returns.beam + {"previous": -1, "above": -firings, "below": firings}[whose]
        there = (other >= 0) & (other < beams)
        if whose == "previous":
            there &= returns.beam % firings > 0
        return np.where(there, shown[np.clip(other, 0, beams - 1)], np.float32(0))

    def firing(self, returns: Returns) -> np.ndarray:
        """Number (m,) of each return's firing within the revolution, from 0 on."""
        ring = self.rays.ring[returns.beam]
        fan = np.radians(np.array(self.pattern.azimuth_offset_deg))[ring]
        turned = np.pi - (self.rays.azimuth[returns.beam] - fan)
        return np.rint(turned * self.pattern.firings / (2 * np.pi) - 0.5).astype(int) % self.pattern.firings

    def named(self, what: str, returns: Returns) -> np.ndarray:
        """(m,) str: `kinds` or `models` of what returns come from; empty for the static world, and without a world."""
        names = ("",) if self.instances is None else (*getattr(self.instances, what), "")
        return np.array(names)[np.where(returns.instance >= 0, returns.instance, -1)]

    def per_return(self, returns: Returns, draw: np.ndarray) -> np.ndarray:
        """Values (m,) out of a draw (2, n): its row is the return's number, so a beam's fate is its own."""
        return draw[np.minimum(returns.return_no, 1), returns.beam]

    def is_material(self, attribute: str, returns: Returns) -> np.ndarray:
        """(m,) bool: whether the surface's material has `retro`, `metal`, `road` or `paint`."""
        return self.hits.table.column(attribute)[returns.material] & (returns.instance >= -1)

    @property
    def _traced(self) -> Traced:
        if self.traced is None:
            raise ValueError("beams have not been traced at this stage; use an echo, point or scan effect")
        return self.traced


def returns_of(hits: Hits, layer: str = "solid") -> Returns:
    """Every solid surface met, or every first pane, with its bare reflectance as intensity."""
    if layer == "solid":
        beam = np.flatnonzero(hits.solid.exists).astype(np.int32)
        surface = hits.solid.take(beam)
        intensity = reflectance = hits.reflectance(surface)
    else:
        beam, surface = hits.pane_beam, hits.pane
        reflectance = hits.reflectance(surface)
        intensity = np.zeros(len(beam), np.float32)
    return Returns(
        beam=beam,
        range_m=surface.range_m,
        intensity=intensity,
        reflectance=reflectance,
        normal_code=surface.normal_code,
        material=surface.material,
        instance=surface.instance,
        return_no=np.zeros(len(beam), np.uint8),
    )
