"""Traffic signs and signals: origin at the foot, the approaching driver looks along +x at them."""

from __future__ import annotations

import numpy as np

from assets.mesh import Mesh
from assets.shapes import box, extrude, tube
from assets.world.furniture.sign_faces import sign_face
from assets.world.furniture.street_furniture import pole

_PLATE_M = 0.02
_POST_M = 0.03
_LOW_HEAD_M = (-0.2, 0.0, 2.9)


def _polygon(corners: int, radius_m: float, turn_rad: float) -> np.ndarray:
    angle = turn_rad + 2 * np.pi * np.arange(corners) / corners
    return radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)


_SHAPES = {
    "stop": _polygon(8, 0.41, np.pi / 8),
    "yield": _polygon(3, 0.52, np.pi),  # points down: the polygon holds y, z turned a quarter below
    "speed": _polygon(12, 0.30, 0.0),
    "parking": np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]]),
    "direction": np.array([[-0.75, -0.22], [0.75, -0.22], [0.75, 0.22], [-0.75, 0.22]]),
    "warning": _polygon(3, 0.50, 0.0),
}
SIGN_KINDS = tuple(_SHAPES)


def sign(kind: str, clear_m: float = 2.2, text: str = "50") -> Mesh:
    """A sign on a post: retro-reflecting face towards −x, bare metal behind.

    Args:
        kind: one of `SIGN_KINDS`.
        clear_m: height of the plate's middle less 0.4 m.
        text: what a speed sign says.
    """
    outline = _SHAPES[kind]
    if kind in ("yield", "warning"):
        outline = outline[:, ::-1] * [-1.0, 1.0]  # a quarter turn: the corner at angle 0 points up
    middle = (-_POST_M - _PLATE_M, 0.0, clear_m + 0.4)
    plate = extrude(outline, _PLATE_M, "sign_back", axis="x").moved(middle)
    faces_driver = plate.normals[:, 0] < -0.5
    back = plate.select(~faces_driver)
    front = plate.vertices[plate.faces[faces_driver]].reshape(-1, 3)
    face = sign_face(kind, outline, text).moved((float(front[:, 0].min()), 0.0, middle[2]))
    post = pole(_POST_M, _POST_M, clear_m + 0.4 + 0.2, "steel_galvanised", segments=5)
    return Mesh.merge([post, back, face])


def signal_head() -> Mesh:
    """Three lamps with visors in a dark housing, lenses towards −x, centred on the origin."""
    parts = [box((0.22, 0.30, 0.95), (0, 0, 0), "signal_housing")]
    parts.append(box((0.02, 0.46, 1.12), (0.06, 0, 0), "signal_housing"))
    for z in (-0.3, 0.0, 0.3):
        parts.append(lens(z, "signal_lens"))
        parts.append(_visor(z + 0.125))
    return Mesh.merge(parts)


def lens(height_m: float, material: str, lifted_m: float = 0.0) -> Mesh:
    """A lens of a signal head at a height from its middle, `lifted_m` towards who looks at it."""
    disc = extrude(_polygon(8, 0.10, 0.0), 0.02, material, axis="x")
    return disc.select(disc.normals[:, 0] < -0.5).moved((-0.115 - lifted_m, 0, height_m))


def head_positions(arm_m: float = 0.0, *, left_hand: bool = False) -> np.ndarray:
    """Middles (k, 3) of the heads of a `signal_pole`, in its axes."""
    side = -1.0 if left_hand else 1.0
    return np.array([_LOW_HEAD_M] + ([(-0.2, side * (arm_m - 0.1), 5.55)] if arm_m > 0 else []))


def _visor(z_m: float) -> Mesh:
    """A thin hood over a lens, seen from above and below."""
    top = np.array([[-0.29, -0.12, z_m], [-0.11, -0.12, z_m], [-0.11, 0.12, z_m], [-0.29, 0.12, z_m]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6]])
    return Mesh.of(np.vstack([top, top - [0, 0, 0.01]]), faces, "signal_housing")


def signal_pole(arm_m: float = 0.0, *, left_hand: bool = False) -> Mesh:
    """A roadside signal; with `arm_m` > 0 a mast also carries a head over the lanes, to its left.

    Where one drives on the left, the lanes are to its right.
    """
    side = -1.0 if left_hand else 1.0
    mast = pole(0.06, 0.06, 3.6 if arm_m == 0 else 5.9, "steel_painted", segments=8)
    parts = [mast, signal_head().moved(_LOW_HEAD_M), box((0.12, 0.05, 0.05), (-0.06, 0, 2.9), "steel_painted")]
    parts.append(box((0.09, 0.10, 0.15), (0, 0.09, 1.05), "plastic_bright"))  # push button
    if arm_m > 0:
        path = np.array([[0, 0, 5.6], [0, side * arm_m * 0.5, 5.85], [0, side * arm_m, 5.9]])
        parts.append(tube(path, [0.06, 0.05, 0.04], "steel_painted", segments=6))
        parts.append(signal_head().moved(tuple(head_positions(arm_m, left_hand=left_hand)[1])))
    return Mesh.merge(parts)
