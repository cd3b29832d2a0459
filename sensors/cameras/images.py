"""Images of one camera pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import cv2
import numpy as np

Content = Literal["colour", "number", "depth"]
CONTENTS: tuple[Content, ...] = ("colour", "number", "depth")


@dataclass(frozen=True, eq=False)
class Images:
    """Pixel-aligned images of one camera at one instant, as they were read back; each is completed on demand.

    Attributes:
        near_m: near plane of the pass [m].
        rgba: (h, w, 4) uint8, square root of linear light × 255: close to sRGB, and cheap to invert; last the material.
        number: (h, w) uint16, 0 for the static world and the sky, k + 1 for the k-th instance given.
        inverse_depth: (h, w) float32, near_m / depth, 0 where nothing is hit.

    An array is None if it was not requested; images that are derived from it are then not available.
    """

    near_m: float
    rgba: np.ndarray | None
    number: np.ndarray | None
    inverse_depth: np.ndarray | None

    @cached_property
    def rgb(self) -> np.ndarray:
        """(h, w, 3) uint8."""
        return cv2.cvtColor(_read(self.rgba, "colour"), cv2.COLOR_RGBA2RGB)

    @cached_property
    def gray(self) -> np.ndarray:
        """(h, w) uint8, luma of `rgb`."""
        return cv2.cvtColor(_read(self.rgba, "colour"), cv2.COLOR_RGBA2GRAY)

    @cached_property
    def material(self) -> np.ndarray:
        """(h, w) uint8, 0 for the sky, k + 1 for row k of the material table."""
        return cv2.extractChannel(_read(self.rgba, "colour"), 3)

    @property
    def instance(self) -> np.ndarray:
        """(h, w) uint16, 0 for the static world and the sky, k + 1 for the k-th instance given."""
        return _read(self.number, "number")

    @cached_property
    def depth_m(self) -> np.ndarray:
        """(h, w) float32 depth along the optical axis at the pixel's centre, 0 where nothing is hit."""
        return self._depth_m(_read(self.inverse_depth, "depth"))

    def depth_at(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """`depth_m` of some pixels (n,)."""
        return self._depth_m(_read(self.inverse_depth, "depth")[rows, columns])

    def _depth_m(self, inverse: np.ndarray) -> np.ndarray:
        depth = np.zeros_like(inverse)
        np.divide(np.float32(self.near_m), inverse, out=depth, where=inverse > 0)
        return depth


def _read(array: np.ndarray | None, content: str) -> np.ndarray:
    if array is None:
        raise ValueError(f"{content!r} was not rendered; add it to the requested contents of the pass")
    return array
