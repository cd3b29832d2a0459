"""Bridge from SUMO's road users to posed meshes: model, paint and pose on the road surface."""

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
_NARROW_HALF_TRACK_M = 0.15
_MAX_WHEEL_SHIFT_M = 0.02  # maximum distance of wheels above or below the road when the body tilts
_MAX_TILT_RAD = np.radians(1.5)
_TEXTURE_M = 0.004  # height of the road texture, which is not part of the mesh


@dataclass(frozen=True)
class Look:
    """Model, scale and paint of a road user; constant during the simulation."""

    model: ModelSpec
    scale: tuple[float, float, float]
    paint: Paint


class Bridge:
    """Gives every SUMO road user a mesh of exactly its vType's size and a pose on the road surface.

    Model and paint depend on the road user's id and the seed, so they are constant within a run and equal in repeated
    runs. If the catalogue has no model of the vType's size, the most similar model of its kind is scaled.

    Args:
        ground: road surface.
        seed: seed of the choice of models and paints.
        external: models used in addition to the catalogue, each with the same probability as one of those.
    """

    def __init__(self, ground: Ground, seed: int, external: ExternalModels | None = None) -> None:
        self._ground = ground
        self._seed = seed
        self._external = external or ExternalModels()
        self._looks: dict[tuple[str, str], Look] = {}
        self._parked: dict[str, tuple[list[float], np.ndarray]] = {}  # SUMO position and pose of parked vehicles

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
        """World poses (n, 4, 4); the poses of parked vehicles are cached."""
        before, self._parked = self._parked, {}
        positions = np.column_stack([actors.front, actors.heading_rad]).tolist()
        poses, changed = np.empty((len(actors), 4, 4)), []
        for row, (name, parked) in enumerate(zip(actors.ids, actors.parked.tolist(), strict=True)):
            cached = before.get(name) if parked else None
            if cached is not None and cached[0] == positions[row]:
                poses[row] = cached[1]
                self._parked[name] = cached
            else:
                changed.append(row)
        rows = np.array(changed, int)
        poses[rows] = self._compute_poses(actors.take(rows), [looks[row] for row in changed], scales[rows])
        for row in changed:
            if actors.parked[row] and not actors.body_pitch_rad[row] and not actors.body_roll_rad[row]:
                self._parked[actors.ids[row]] = positions[row], poses[row].copy()
        return poses

    def _look(self, name: str, vtype: str, kind: str, size: np.ndarray) -> Look:
        key = (name, vtype)
        if key not in self._looks:
            rng = np.random.default_rng([self._seed, zlib.crc32(name.encode())])
            specs = [*models_of_size(kind, size), *self._external.of_size(kind, size)]
            spec = specs[int(rng.integers(len(specs)))]
            length, width, height = (float(target / own) for target, own in zip(size, spec.size_m, strict=True))
            self._looks[key] = Look(spec, (length, width, height), draw_paint(kind, rng))
        return self._looks[key]

    def _compute_poses(self, actors: Actors, looks: list[Look], scales: np.ndarray) -> np.ndarray:
        """World poses (n, 4, 4) on the least-squares plane through the ground under the four wheels."""
        forward = np.stack([np.cos(actors.heading_rad), np.sin(actors.heading_rad)], 1)
        left = np.stack([-forward[:, 1], forward[:, 0]], 1)
        is_pedestrian = np.array([kind == "pedestrian" for kind in actors.kinds], bool)
        # SUMO reports the front bumper of vehicles, but the centre of pedestrians.
        centre = actors.front[:, :2] - forward * np.where(is_pedestrian, 0, actors.size[:, 0] / 2)[:, None]

        axles = np.array([(look.model.front_axle_x_m, look.model.rear_axle_x_m) for look in looks]).reshape(-1, 2)
        axles = np.where(is_pedestrian[:, None], [0.1, -0.1], axles * scales[:, :1])
        half_track = np.array([look.model.track_m / 2 for look in looks]) * scales[:, 1]
        half_track = np.where(half_track > 0, half_track, _NARROW_HALF_TRACK_M)
        # wheels: front left, front right, rear left, rear right
        along = axles[:, [0, 0, 1, 1]]
        across = half_track[:, None] * np.array([1, -1, 1, -1])
        wheels = centre[:, None] + along[..., None] * forward[:, None] + across[..., None] * left[:, None]
        height = np.broadcast_to(actors.front[:, None, 2:], (*wheels.shape[:2], 1))
        z = self._ground.height(np.concatenate([wheels, height], 2).reshape(-1, 3)).reshape(-1, 4)

        # least-squares plane through four points on a rectangle
        slope = (z[:, :2].mean(1) - z[:, 2:].mean(1)) / (axles[:, 0] - axles[:, 1])
        bank = (z[:, [0, 2]].mean(1) - z[:, [1, 3]].mean(1)) / (2 * half_track)
        is_upright = is_pedestrian | np.array([look.model.track_m == 0 for look in looks], bool)
        bank = np.where(is_upright, 0, bank)
        slope = np.where(is_pedestrian, 0, slope)
        base = z.mean(1) - slope * axles.mean(1) + _TEXTURE_M

        # The suspension rotates the rigid mesh about the centre between the wheels, within the limits of wheel shift.
        pitch, roll = (np.where(is_upright, 0, angle) for angle in (actors.body_pitch_rad, actors.body_roll_rad))
        pitch = _limit_tilt(pitch, 2 * _MAX_WHEEL_SHIFT_M / (axles[:, 0] - axles[:, 1]))
        roll = _limit_tilt(roll, _MAX_WHEEL_SHIFT_M / half_track)
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
    """World velocity (n, 3) [m/s]: along the pose's x axis, plus a horizontal lateral component."""
    sideways = np.column_stack([-np.sin(actors.heading_rad), np.cos(actors.heading_rad), np.zeros(len(actors))])
    return actors.speed_mps[:, None] * poses[:, :3, 0] + actors.lateral_mps[:, None] * sideways


def _limit_tilt(angle: np.ndarray, limit: np.ndarray) -> np.ndarray:
    return np.clip(angle, -np.minimum(limit, _MAX_TILT_RAD), np.minimum(limit, _MAX_TILT_RAD))


def models_of_size(kind: str, size: np.ndarray) -> tuple[ModelSpec, ...]:
    """Catalogue models of a kind whose box equals `size` (3,) [m], or else those that need the least scaling."""
    return _models_of_size(kind, tuple(np.asarray(size, float).tolist()))


@lru_cache(maxsize=4096)  # more than the number of vTypes
def _models_of_size(kind: str, size: tuple[float, float, float]) -> tuple[ModelSpec, ...]:
    same_kind = [spec for spec in CATALOGUE.values() if spec.kind == kind]
    exact = tuple(spec for spec in same_kind if np.abs(np.subtract(spec.size_m, size)).max() < _SAME_SIZE_M)
    if exact:
        return exact
    stretches = [stretch(spec, np.array(size)) for spec in same_kind]
    least = min(stretches) + _SAME_STRETCH
    return tuple(spec for spec, value in zip(same_kind, stretches, strict=True) if value <= least)
