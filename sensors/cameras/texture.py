"""Structure of surfaces in colour images: the reflectance fields that LiDAR sensors see, at the same places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from assets.materials import TABLE
from sensors.cameras.cast_shadows import world_points
from sensors.cameras.images import Images
from sensors.effects.light.reflectance_field import ReflectanceField
from sensors.effects.material_groups import group_members, shift_of_instance
from sensors.scene import Instances
from sensors.sensor_model import SensorModel, load_sensor

# Contrast in visible light over that at the LiDAR's wavelength, where it differs from 1. Paint has none: its dirt and
# gloss change what a LiDAR receives, not its colour.
_CONTRAST: dict[str, float] = {"building": 0.5, "other": 0.4, "vehicle": 0.0}
# Fields that only a camera resolves.
_FINE = (
    ReflectanceField(surfaces="road", sigma=0.12, cell_m=0.02),
    ReflectanceField(surfaces="ground", sigma=0.2, cell_m=0.02),
    ReflectanceField(surfaces="vegetation", sigma=0.4, cell_m=0.02),
    ReflectanceField(surfaces="building", sigma=0.16, cell_m=0.03),
)


def fields_of(sensor: SensorModel) -> tuple[ReflectanceField, ...]:
    """Return the reflectance fields of a sensor; those of the sensor `kitti` if it has none."""
    fields = tuple(effect for effect in sensor.effects if isinstance(effect, ReflectanceField))
    return fields or fields_of(load_sensor("kitti"))


def textured(
    images: Images,
    strength: float,
    pose: np.ndarray,
    P: np.ndarray,
    instances: Instances,
    fields: Sequence[ReflectanceField],
) -> Images:
    """Images whose light is multiplied by a power of the reflectance of the fields at each pixel.

    Args:
        images: with colour, number and depth.
        strength: exponent; 0 changes nothing.
        pose: (4, 4) world-from-camera.
        P: (3, 4) projection.
        instances: movable objects, in the order of the images' numbers.
        fields: fields that a LiDAR sees, too.
    """
    if not strength or images.rgba is None:
        return images
    rows, columns = np.nonzero(images.depth_m > 0)
    material, number = images.material[rows, columns].astype(int) - 1, images.instance[rows, columns].astype(int) - 1
    places = _on_surfaces(world_points(rows, columns, images.depth_at(rows, columns), pose, P), number, instances)
    log_light = np.zeros(len(rows), np.float32)
    for field in (*fields, *_FINE):
        contrast = np.float32(strength * _CONTRAST.get(field.surfaces, 1.0))
        members = np.flatnonzero(np.isin(material, np.flatnonzero(group_members(field.surfaces, TABLE))))
        log_light[members] += contrast * field.log_factor(places[members])
    rgba = images.rgba.copy()
    root = rgba[rows, columns, :3] * np.exp(log_light / 2)[:, None]  # pixels hold the square root of light
    rgba[rows, columns, :3] = np.rint(np.minimum(root, 255))
    return replace(images, rgba=rgba)


def _on_surfaces(points: np.ndarray, number: np.ndarray, instances: Instances) -> np.ndarray:
    """Positions (n, 3) in the world, or in the axes of the instance `number` (n,), shifted by its name."""
    moved = np.flatnonzero((number >= 0) & (number < len(instances)))
    row = number[moved]
    arm = points[moved] - instances.poses[row, :3, 3]
    points[moved] = np.einsum("nji,nj->ni", instances.poses[row, :3, :3], arm)
    points[moved] += shift_of_instance(instances.ids)[row, None]
    return points.astype(np.float32)
