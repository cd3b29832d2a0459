"""Faces of traffic signs: coloured sheets in front of each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assets.mesh import Mesh
from assets.shapes import triangulate

_LAYER_M = 0.002
# Strokes of characters 2 wide and 4 high, as (left, bottom, right, top) of bars one thick, y to the right.
_TOP, _MIDDLE, _BOTTOM = (0, 3.4, 2, 4), (0, 1.7, 2, 2.3), (0, 0, 2, 0.6)
_UPPER_LEFT, _UPPER_RIGHT = (0, 1.7, 0.6, 4), (1.4, 1.7, 2, 4)
_LOWER_LEFT, _LOWER_RIGHT = (0, 0, 0.6, 2.3), (1.4, 0, 2, 2.3)
_STROKES: dict[str, tuple[tuple[float, float, float, float], ...]] = {
    "0": (_TOP, _BOTTOM, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_LEFT, _LOWER_RIGHT),
    "1": (_UPPER_RIGHT, _LOWER_RIGHT),
    "2": (_TOP, _MIDDLE, _BOTTOM, _UPPER_RIGHT, _LOWER_LEFT),
    "3": (_TOP, _MIDDLE, _BOTTOM, _UPPER_RIGHT, _LOWER_RIGHT),
    "4": (_MIDDLE, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_RIGHT),
    "5": (_TOP, _MIDDLE, _BOTTOM, _UPPER_LEFT, _LOWER_RIGHT),
    "6": (_TOP, _MIDDLE, _BOTTOM, _UPPER_LEFT, _LOWER_LEFT, _LOWER_RIGHT),
    "7": (_TOP, _UPPER_RIGHT, _LOWER_RIGHT),
    "8": (_TOP, _MIDDLE, _BOTTOM, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_LEFT, _LOWER_RIGHT),
    "9": (_TOP, _MIDDLE, _BOTTOM, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_RIGHT),
    "S": (_TOP, _MIDDLE, _BOTTOM, _UPPER_LEFT, _LOWER_RIGHT),
    "T": (_TOP, (0.7, 0, 1.3, 4)),
    "O": (_TOP, _BOTTOM, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_LEFT, _LOWER_RIGHT),
    "P": (_TOP, _MIDDLE, _UPPER_LEFT, _UPPER_RIGHT, _LOWER_LEFT),
}
_ARROW = np.array([[0.62, 0], [0.32, -0.17], [0.32, -0.07], [-0.6, -0.07], [-0.6, 0.07], [0.32, 0.07], [0.32, 0.17]])


def sign_face(kind: str, outline: np.ndarray, text: str = "") -> Mesh:
    """The face of a sign in the plane x = 0, looking towards −x.

    Args:
        kind: `stop`, `yield`, `speed`, `parking`, `direction` or `warning`.
        outline: (n, 2) corners of its plate, y to the left and z up.
        text: what a speed sign says.
    """
    middle = outline.mean(0)
    layers: list[tuple[str, list[np.ndarray]]]
    if kind == "stop":
        layers = [("sign_face", [outline]), ("sign_red", [_inside(outline, 0.93)]), ("sign_face", _text("STOP", 0.22))]
    elif kind == "yield":
        layers = [("sign_red", [outline]), ("sign_face", [_inside(outline, 0.62)])]
    elif kind == "warning":
        mark = [_bar(-0.03, -0.02, 0.03, 0.17), _bar(-0.03, -0.11, 0.03, -0.05)]
        layers = [("sign_red", [outline]), ("sign_face", [_inside(outline, 0.66)])]
        layers.append(("sign_black", [piece + middle for piece in mark]))
    elif kind == "speed":
        layers = [("sign_red", [outline]), ("sign_face", [_inside(outline, 0.78)]), ("sign_black", _text(text, 0.24))]
    elif kind == "parking":
        layers = [("sign_face", [outline]), ("sign_blue", [_inside(outline, 0.94)]), ("sign_face", _text("P", 0.36))]
    else:
        layers = [("sign_black", [outline]), ("sign_yellow", [_inside(outline, 0.96)]), ("sign_black", [_ARROW])]
    return Mesh.merge(
        [
            _sheet(piece, -_LAYER_M * depth, material)
            for depth, (material, pieces) in enumerate(layers)
            for piece in pieces
        ]
    )


def _inside(outline: np.ndarray, share: float) -> np.ndarray:
    middle = outline.mean(0)
    return middle + share * (outline - middle)


def _text(text: str, height_m: float) -> list[np.ndarray]:
    """Bars of a line of text about the origin."""
    unit = height_m / 4
    width = 3 * len(text) - 1
    bars = []
    for position, letter in enumerate(text):
        for left, bottom, right, top in _STROKES[letter]:
            from_left = 3 * position - width / 2
            ends = (-(from_left + right), bottom - 2, -(from_left + left), top - 2)  # the left of who looks is +y
            bars.append(_bar(*(unit * end for end in ends)))
    return bars


def _bar(left: float, bottom: float, right: float, top: float) -> np.ndarray:
    return np.array([[left, bottom], [right, bottom], [right, top], [left, top]])


def _sheet(corners: Sequence[Sequence[float]] | np.ndarray, x: float, material: str) -> Mesh:
    """A flat piece at x, seen from −x."""
    points, faces = triangulate(np.asarray(corners, np.float64))
    return Mesh.of(np.insert(points, 0, x, axis=1), faces[:, ::-1], material)
