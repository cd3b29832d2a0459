"""Whom annotators label, and whom they call occluded.

The smaller an object looks, the likelier it is left to a DontCare region.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

_CERTAIN_PX = 45.0


class Annotators(BaseModel):
    """How small an object may look in the image and still be labelled.

    The share labelled is 1 / (1 + (height / height_px)^(−1/spread)). The default is what KITTI's own annotators left:
    in 7481 label files cars and DontCare regions are equally frequent at 21 px of height, cars are a quarter of both
    at 15 px and nine tenths at 45 px, from where on everybody is labelled here.

    They tick "partly" and "largely occluded" by eye. Of 12,501 of their untruncated cars 44 % are visible, 31 % partly
    and 25 % largely occluded; they tick partly even what a post hides a little of, or a neighbour's corner. In the
    towns the shares are the same, with as many points on the cars, where cars count as partly occluded from 2 % of
    their pixels on and as largely from 45 % on. The published code of "Synth It Like KITTI" has 10 % and 75 %.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = Field(default=True, description="whether what looks small is left to DontCare regions at all")
    height_px: float = Field(
        default=21.0, gt=0, le=200, description="height of the 2D box at which half of the objects are labelled [px]"
    )
    spread: float = Field(
        default=0.28, ge=0, le=2, description="how gradually they begin, in logarithms of height; 0: a sharp limit [1]"
    )

    partly_hidden: float = Field(
        default=0.02, ge=0, le=1, description="share of its pixels that is hidden of what is partly occluded [1]"
    )
    largely_hidden: float = Field(
        default=0.45, ge=0, le=1, description="share that is hidden of what is largely occluded [1]"
    )

    @model_validator(mode="after")
    def _in_order(self) -> Annotators:
        if self.partly_hidden > self.largely_hidden:
            raise ValueError(
                f"partly_hidden is {self.partly_hidden}, largely_hidden {self.largely_hidden}; give the smaller first"
            )
        return self

    def occlusion(self, hidden_share: np.ndarray) -> np.ndarray:
        """KITTI's level (n,) int64 of objects of which a share is hidden: 0 visible, 1 partly, 2 largely occluded."""
        return np.searchsorted((self.partly_hidden, self.largely_hidden), hidden_share, side="right")

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
