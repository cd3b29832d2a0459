"""Whom annotators label: the smaller an object looks, the likelier it is left to a DontCare region."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

_CERTAIN_PX = 45.0


class Annotators(BaseModel):
    """How small an object may look in the image and still be labelled.

    The share labelled is 1 / (1 + (height / height_px)^(−1/spread)). The default is what KITTI's own annotators left:
    in 7481 label files cars and DontCare regions are equally frequent at 21 px of height, cars are a quarter of both
    at 15 px and nine tenths at 45 px, from where on everybody is labelled here.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = Field(default=True, description="whether what looks small is left to DontCare regions at all")
    height_px: float = Field(
        default=21.0, gt=0, le=200, description="height of the 2D box at which half of the objects are labelled [px]"
    )
    spread: float = Field(
        default=0.28, ge=0, le=2, description="how gradually they begin, in logarithms of height; 0: a sharp limit [1]"
    )

    def overlook(self, ids: Sequence[str], height_px: np.ndarray, seed: int) -> np.ndarray:
        """Whom they leave to a DontCare region, (n,) bool.

        Everybody has one limit of height for good, drawn by id and seed, so that who has been labelled stays labelled
        while coming nearer.

        Args:
            ids: of n objects.
            height_px: (n,) heights of their 2D boxes.
            seed: of the drawing.
        """
        if not self.enabled:
            return np.zeros(len(ids), bool)
        share = np.array([_draw(f"{seed}/{name}") for name in ids], float)
        limit = np.minimum(self.height_px * (share / (1 - share)) ** self.spread, max(_CERTAIN_PX, self.height_px))
        return np.asarray(height_px) < limit


def _draw(text: str) -> float:
    """A number in (0, 1) that the text determines."""
    digest = hashlib.blake2b(text.encode(), digest_size=4).digest()
    return (int.from_bytes(digest, "big") + 0.5) / 2.0**32
