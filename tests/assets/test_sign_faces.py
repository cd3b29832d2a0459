"""Traffic signs show their faces to who approaches them, and bare metal to all others."""

from __future__ import annotations

import numpy as np
import pytest

from assets.materials import MATERIAL_NAMES, MATERIALS
from assets.world.furniture.signs import SIGN_KINDS, sign
from sensors.bvh import Bvh

HEIGHT_M = 2.6


def seen(mesh, y: float, z: float, *, from_behind: bool = False) -> str:
    """Material that a horizontal beam hits at a position of the sign."""
    start = np.array([[3.0 if from_behind else -3.0, y, z]], np.float32)
    ahead = np.array([[-1.0 if from_behind else 1.0, 0, 0]], np.float32)
    _, triangle = Bvh(mesh).first_hit(start, ahead, np.array([10.0], np.float32))
    return MATERIAL_NAMES[mesh.materials[triangle[0]]] if triangle[0] >= 0 else ""


@pytest.mark.parametrize(
    ("kind", "y", "z", "material"),
    [
        ("yield", 0.0, 0.0, "sign_face"),
        ("yield", 0.0, -0.45, "sign_red"),  # its tip is at the bottom
        ("warning", 0.0, 0.42, "sign_red"),  # and this one points up
        ("warning", 0.0, 0.05, "sign_black"),
        ("stop", 0.0, 0.3, "sign_red"),
        ("stop", 0.0, 0.398 * np.cos(np.pi / 8), "sign_face"),
        ("speed", 0.28, 0.0, "sign_red"),
        ("speed", 0.0, 0.18, "sign_face"),
        ("parking", 0.25, 0.25, "sign_blue"),
        ("direction", 0.0, 0.0, "sign_black"),
        ("direction", 0.0, 0.18, "sign_yellow"),
    ],
)
def test_faces_have_their_colours(kind, y, z, material):
    assert seen(sign(kind), y, HEIGHT_M + z) == material


@pytest.mark.parametrize("kind", SIGN_KINDS)
def test_from_behind_there_is_metal(kind):
    assert seen(sign(kind), 0.15, HEIGHT_M + 0.02, from_behind=True) == "sign_back"


def test_a_speed_sign_says_its_limit():
    """The first digit of 30 has its strokes on the right, that of 50 above on the left."""
    digit, upper = 0.09, 0.06  # to the left of the middle, above it
    assert seen(sign("speed", text="50"), digit + 0.045, HEIGHT_M + upper) == "sign_black"
    assert seen(sign("speed", text="30"), digit + 0.045, HEIGHT_M + upper) == "sign_face"
    assert seen(sign("speed", text="30"), digit - 0.045, HEIGHT_M + upper) == "sign_black"


def test_print_shines_back_but_black_does_not():
    assert all(MATERIALS[name].retro for name in ("sign_face", "sign_red", "sign_blue", "sign_yellow"))
    assert not MATERIALS["sign_black"].retro
