"""Wavefront OBJ: positions, polygons and their material names.

Read here rather than by a library, because a mesh often comes without its `.mtl` file, and its material names
are wanted all the same; textures never are, so nothing but the file itself is opened.
"""

from __future__ import annotations

from collections import defaultdict
from itertools import pairwise

import numpy as np


def parse_obj(text: str) -> list[tuple[np.ndarray, np.ndarray, str]]:
    """Parts of one material: vertices (n, 3) float64, triangles (m, 3) int64, material name or group name.

    Polygons are cut into fans, which suits convex ones.

    Raises:
        ValueError: a line cannot be read, or a polygon names a vertex that is not there.
    """
    vertices: list[list[float]] = []
    triangles: dict[str, list[tuple[int, int, int]]] = defaultdict(list)
    material = group = ""
    for number, line in enumerate(text.replace("\\\n", " ").splitlines(), 1):
        key, _, rest = line.strip().partition(" ")
        try:
            if key == "v":
                vertices.append([float(word) for word in rest.split()[:3]])
                if len(vertices[-1]) != 3:
                    raise ValueError("a vertex needs three coordinates")
            elif key == "f":
                corners = [_corner(word, len(vertices)) for word in rest.split()]
                fan = pairwise(corners[1:])
                triangles[material or group].extend((corners[0], a, b) for a, b in fan)
            elif key == "usemtl":
                material = rest.strip()
            elif key in ("o", "g"):
                group = rest.strip()
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from None
    table = np.array(vertices, np.float64).reshape(-1, 3)
    return [(table, np.array(faces, np.int64), name) for name, faces in triangles.items()]


def _corner(word: str, count: int) -> int:
    index = int(word.split("/")[0])
    row = index - 1 if index > 0 else count + index
    if not 0 <= row < count:
        raise ValueError(f"a polygon names vertex {index}, of {count} so far")
    return row
