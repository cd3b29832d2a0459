"""From SUMO's road users to posed models: which mesh, which paint, and how it stands on the road."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from assets import CATALOGUE, ModelSpec, Paint, draw_paint
from assets.external import ExternalModels
from assets.external.models import stretch
from cosim.scene.ground import Ground
from cosim.traffic.actors import Actors
from sensors.scene import Instances

_SAME_SIZE_M = 1e-6
_SAME_STRETCH = 1e-9
_HALF_TRACK_OF_NARROW_M = 0.15
_WHEELS_SHIFT_M = 0.02  # how far wheels may leave the road with the body, each way
_LARGEST_LEAN_RAD = np.radians(1.5)
_TEXTURE_M = 0.004  # tyres rest on the tips of the road's texture, which its mesh lacks


@dataclass(frozen=True)
class Look:
    """What one road user looks like for as long as it lives."""

    model: ModelSpec
    scale: tuple[float, float, float]
    paint: Paint


class Bridge:
    """Gives every SUMO road user a mesh of exactly its vType's size and a pose on the road surface.

    Model and paint are drawn by the road user's id and the seed, so they stay the same throughout and in every
    run. Where the catalogue holds no model of the vType's size, the nearest of its kind is scaled to it.

    Args:
        ground: the surface to stand on.
        seed: of the drawing of models and paints.
        external: models drawn beside the catalogue's, each as often as one of those.
    """

    def __init__(self, ground: Ground, seed: int, external: ExternalModels | None = None) -> None:
        self._ground = ground
        self._seed = seed
        self._external = external or ExternalModels()
        self._looks: dict[tuple[str, str], Look] = {}
        self._resting: dict[str, tuple[list[float], np.ndarray]] = {}  # where those stand who are parked

    def place(self, actors: Actors) -> Instances:
        """Posed instances of all actors, in their order."""
        looks = [
            self._look(name, vtype, kind, size)
            for name, vtype, kind, size in zip(actors.ids, actors.types, actors.kinds, actors.size, strict=True)
        ]
        scales = np.array([look.scale for look in looks], float).reshape(-1, 3)
        poses = self._poses(actors, looks, scales)
        return Instances(
            ids=actors.ids,
            kinds=actors.kinds,
            models=tuple(look.model.name for look in looks),
            poses=poses,
            scales=scales,
            sizes=actors.size,
            velocity_mps=_velocity(actors, poses),
            yaw_rate_radps=actors.yaw_rate_radps,
            paint=np.array([look.paint.reflectance for look in looks], np.float32),
            rgb=np.array([look.paint.rgb for look in looks], np.float32).reshape(-1, 3),
        )

    def _poses(self, actors: Actors, looks: list[Look], scales: np.ndarray) -> np.ndarray:
        """World poses (n, 4, 4); those who are parked keep theirs for as long as they stand."""
        before, self._resting = self._resting, {}
        places = np.column_stack([actors.front, actors.heading_rad]).tolist()
        poses, stirring = np.empty((len(actors), 4, 4)), []
        for row, (name, parked) in enumerate(zip(actors.ids, actors.parked.tolist(), strict=True)):
            known = before.get(name) if parked else None
            if known is not None and known[0] == places[row]:
                poses[row] = known[1]
                self._resting[name] = known
            else:
                stirring.append(row)
        rows = np.array(stirring, int)
        poses[rows] = self._stand(actors.take(rows), [looks[row] for row in stirring], scales[rows])
        for row in stirring:
            if actors.parked[row] and not actors.body_pitch_rad[row] and not actors.body_roll_rad[row]:
                self._resting[actors.ids[row]] = places[row], poses[row].copy()
        return poses

    def _look(self, name: str, vtype: str, kind: str, size: np.ndarray) -> Look:
        key = (name, vtype)
        if key not in self._looks:
            rng = np.random.default_rng([self._seed, zlib.crc32(name.encode())])
            specs = [*models_of_size(kind, size), *self._external.of_size(kind, size)]
            spec = specs[int(rng.integers(len(specs)))]
            length, width, height = (float(wanted / own) for wanted, own in zip(size, spec.size_m, strict=True))
            self._looks[key] = Look(spec, (length, width, height), draw_paint(kind, rng))
        return self._looks[key]

    def _stand(self, actors: Actors, looks: list[Look], scales: np.ndarray) -> np.ndarray:
        """World poses (n, 4, 4) with all wheels on the ground, as nearly as a rigid body can."""
        forward = np.stack([np.cos(actors.heading_rad), np.sin(actors.heading_rad)], 1)
        left = np.stack([-forward[:, 1], forward[:, 0]], 1)
        walks = np.array([kind == "pedestrian" for kind in actors.kinds], bool)
        # SUMO reports the front bumper of vehicles; a pedestrian's position is his middle.
        centre = actors.front[:, :2] - forward * np.where(walks, 0, actors.size[:, 0] / 2)[:, None]

        axles = np.array([(look.model.front_axle_x_m, look.model.rear_axle_x_m) for look in looks]).reshape(-1, 2)
        axles = np.where(walks[:, None], [0.1, -0.1], axles * scales[:, :1])
        half_track = np.array([look.model.track_m / 2 for look in looks]) * scales[:, 1]
        half_track = np.where(half_track > 0, half_track, _HALF_TRACK_OF_NARROW_M)
        # wheels: front left, front right, rear left, rear right
        along = axles[:, [0, 0, 1, 1]]
        across = half_track[:, None] * np.array([1, -1, 1, -1])
        wheels = centre[:, None] + along[..., None] * forward[:, None] + across[..., None] * left[:, None]
        height = np.broadcast_to(actors.front[:, None, 2:], (*wheels.shape[:2], 1))
        z = self._ground.height(np.concatenate([wheels, height], 2).reshape(-1, 3)).reshape(-1, 4)

        # least-squares plane through four points on a rectangle
        slope = (z[:, :2].mean(1) - z[:, 2:].mean(1)) / (axles[:, 0] - axles[:, 1])
        bank = (z[:, [0, 2]].mean(1) - z[:, [1, 3]].mean(1)) / (2 * half_track)
        upright = walks | np.array([look.model.track_m == 0 for look in looks], bool)
        bank = np.where(upright, 0, bank)
        slope = np.where(walks, 0, slope)
        base = z.mean(1) - slope * axles.mean(1) + _TEXTURE_M

        # the body on its springs turns about the middle between its wheels, as far as a rigid mesh may
        pitch, roll = (np.where(upright, 0, angle) for angle in (actors.body_pitch_rad, actors.body_roll_rad))
        pitch = _within(pitch, 2 * _WHEELS_SHIFT_M / (axles[:, 0] - axles[:, 1]))
        roll = _within(roll, _WHEELS_SHIFT_M / half_track)
        base = base + pitch * axles.mean(1)
        slope, bank = slope - pitch, bank - roll

        x_axis = np.column_stack([forward, slope])
        x_axis /= np.linalg.norm(x_axis, axis=1, keepdims=True)
        y_axis = np.column_stack([left, bank])
        y_axis -= np.einsum("ij,ij->i", y_axis, x_axis)[:, None] * x_axis
        y_axis /= np.linalg.norm(y_axis, axis=1, keepdims=True)
        poses = np.tile(np.eye(4), (len(actors), 1, 1))
        poses[:, :3, 0], poses[:, :3, 1], poses[:, :3, 2] = x_axis, y_axis, np.cross(x_axis, y_axis)
        poses[:, :2, 3], poses[:, 2, 3] = centre, base
        return poses


def _velocity(actors: Actors, poses: np.ndarray) -> np.ndarray:
    """World velocity (n, 3): along the pose's own x axis, level where it goes sideways."""
    sideways = np.column_stack([-np.sin(actors.heading_rad), np.cos(actors.heading_rad), np.zeros(len(actors))])
    return actors.speed_mps[:, None] * poses[:, :3, 0] + actors.lateral_mps[:, None] * sideways


def _within(angle: np.ndarray, largest: np.ndarray) -> np.ndarray:
    return np.clip(angle, -np.minimum(largest, _LARGEST_LEAN_RAD), np.minimum(largest, _LARGEST_LEAN_RAD))


def models_of_size(kind: str, size: np.ndarray) -> tuple[ModelSpec, ...]:
    """Catalogue models of a kind whose box equals `size` (3,), or else those that need the least scaling."""
    return _models_of_size(kind, tuple(np.asarray(size, float).tolist()))


@lru_cache(maxsize=4096)  # as many as there are vTypes
def _models_of_size(kind: str, size: tuple[float, float, float]) -> tuple[ModelSpec, ...]:
    same_kind = [spec for spec in CATALOGUE.values() if spec.kind == kind]
    exact = tuple(spec for spec in same_kind if np.abs(np.subtract(spec.size_m, size)).max() < _SAME_SIZE_M)
    if exact:
        return exact
    stretches = [stretch(spec, np.array(size)) for spec in same_kind]
    least = min(stretches) + _SAME_STRETCH
    return tuple(spec for spec, much in zip(same_kind, stretches, strict=True) if much <= least)
