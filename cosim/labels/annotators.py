"""Model of human annotators: which objects they label, and which level of occlusion they choose.

The smaller an object appears in the image, the more likely it is left to a DontCare region.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

_ALWAYS_LABELLED_PX = 45.0


class Annotators(BaseModel):
    """Probability that an object is labelled, and thresholds of the occlusion levels.

    An object is labelled with probability 1 / (1 + (height / height_px)^(−1/spread)). The defaults are fitted to
    KITTI's annotators: in its 7481 label files cars and DontCare regions are equally frequent at a height of 21 px;
    cars are 25 % of both at 15 px and 90 % at 45 px. Objects of 45 px or more are always labelled here.

    KITTI's annotators estimated the occlusion by eye. Of 12,501 untruncated cars 44 % are labelled visible, 31 % partly
    and 25 % largely occluded; even a post or the corner of another car makes a car partly occluded. The default
    thresholds, 2 % and 45 % of hidden pixels, give the same shares in the towns for cars with equal numbers of points.
    The published code of "Synth It Like KITTI" uses 10 % and 75 %.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    enabled: bool = Field(default=True, description="whether small objects are left to DontCare regions")
    height_px: float = Field(
        default=21.0, gt=0, le=200, description="height of the 2D box at which half of the objects are labelled [px]"
    )
    spread: float = Field(
        default=0.28,
        ge=0,
        le=2,
        description="width of the transition, in natural logarithms of the height; 0: a sharp limit [1]",
    )

    partly_hidden: float = Field(
        default=0.02, ge=0, le=1, description="minimum share of hidden pixels of a partly occluded object [1]"
    )
    largely_hidden: float = Field(
        default=0.45, ge=0, le=1, description="minimum share of hidden pixels of a largely occluded object [1]"
    )

    @model_validator(mode="after")
    def _check_order(self) -> Annotators:
        if self.partly_hidden > self.largely_hidden:
            raise ValueError(
                f"partly_hidden is {self.partly_hidden}, largely_hidden {self.largely_hidden}; partly_hidden must not "
                "be larger"
            )
        return self

    def occlusion(self, hidden_share: np.ndarray) -> np.ndarray:
        """KITTI's occlusion level (n,) int64 from hidden shares (n,): 0 visible, 1 partly, 2 largely occluded."""
        return np.searchsorted((self.partly_hidden, self.largely_hidden), hidden_share, side="right")

    def overlook(self, ids: Sequence[str], height_px: np.ndarray, seed: int) -> np.ndarray:
        """Whether each object is left to a DontCare region, (n,) bool.

        Every object has a fixed height limit, drawn from its id and the seed. An object that has been labelled is
        therefore also labelled when it comes closer.

        Args:
            ids: ids of n objects.
            height_px: (n,) heights of their 2D boxes [px].
            seed: seed of the height limits.
        """
        if not self.enabled:
            return np.zeros(len(ids), bool)
        uniform = np.array([_hash_to_uniform(f"{seed}/{name}") for name in ids], float)
        limit = self.height_px * (uniform / (1 - uniform)) ** self.spread
        return np.asarray(height_px) < np.minimum(limit, max(_ALWAYS_LABELLED_PX, self.height_px))


def _hash_to_uniform(text: str) -> float:
    """Hash a text to a number in (0, 1)."""
    digest = hashlib.blake2b(text.encode(), digest_size=4).digest()
    return (int.from_bytes(digest, "big") + 0.5) / 2.0**32
