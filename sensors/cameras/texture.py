"""Structure of surfaces in colour images: the reflectance fields that LiDAR sensors see, at the same places."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from assets.materials import TABLE
from sensors.cameras.cast_shadows import world_points
from sensors.cameras.images import Images
from sensors.effects.light.reflectance_field import ReflectanceField
from sensors.effects.material_groups import Group, group_members, shift_of_instance
from sensors.effects.spatial_noise import field_at
from sensors.scene import Instances


@dataclass(frozen=True)
class _Field:
    surfaces: Group
    sigma: float
    cell_m: float


# Those of the sensor `kitti`, and finer ones that only a camera resolves.
_FIELDS = (
    _Field("road", 0.22, 10.0),
    _Field("ground", 0.35, 10.0),
    _Field("building", 0.35, 4.0),
    _Field("road", 0.05, 0.15),
    _Field("ground", 0.14, 0.2),
    _Field("vegetation", 0.4, 0.3),
    _Field("building", 0.2, 0.6),
    _Field("other", 0.2, 0.2),
    _Field("road", 0.12, 0.02),
    _Field("ground", 0.2, 0.02),
    _Field("vegetation", 0.4, 0.02),
    _Field("building", 0.08, 0.03),
)


def textured(images: Images, strength: float, pose: np.ndarray, P: np.ndarray, instances: Instances) -> Images:
    """Images whose light is multiplied by exp(s·σ·f(p)), f the reflectance fields of what is at each pixel.

    Args:
        images: with colour, number and depth.
        strength: s; 0 changes nothing.
        pose: (4, 4) world-from-camera.
        P: (3, 4) projection.
        instances: movable objects, in the order of the images' numbers.
    """
    if not strength or images.rgba is None:
        return images
    rows, columns = np.nonzero(images.depth_m > 0)
    material, number = images.material[rows, columns].astype(int) - 1, images.instance[rows, columns].astype(int) - 1
    places = _on_surfaces(world_points(rows, columns, images.depth_at(rows, columns), pose, P), number, instances)
    log_light = np.zeros(len(rows), np.float32)
    for field in _FIELDS:
        members = np.flatnonzero(np.isin(material, np.flatnonzero(group_members(field.surfaces, TABLE))))
        values = field_at(places[members], field.cell_m, ReflectanceField.offset_of(field.surfaces))
        log_light[members] += np.float32(strength * field.sigma) * values
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
