"""Silhouette of the sensor's own vehicle, by laser."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator
from scipy.special import ndtr

from sensors.effects.base import EchoEffect, Parameter, bounded
from sensors.effects.phases import Phase
from sensors.pattern import Pattern
from sensors.returns import Returns
from sensors.shot import Shot


class OwnSilhouette(EchoEffect):
    """Beams of laser `rings[k]` between the azimuths `from_deg[k]` and `to_deg[k]` meet the own vehicle and are lost.

    `own_shadow` is the same with rectangles. A measured silhouette has curved bars with the world beyond them. Its ends
    move with load and vibration of the vehicle by up to a degree: in each scan both ends of every sector are drawn
    from normal distributions about their means.
    """

    name: ClassVar = "own_silhouette"
    phase: ClassVar = Phase.DROPOUT
    channel: ClassVar = "drop"
    equation: ClassVar = "lost where ring = rings[k] and from_deg[k] + σε ≤ azimuth < to_deg[k] + σε', ε ~ N(0, 1)"
    reference: ClassVar = "silhouette of the vehicle in KITTI's scans: the same beams are lost in all of them"
    taxonomy: ClassVar = "sp9"
    confusable_with: ClassVar = ("random_dropout", "own_shadow")
    example: ClassVar = {"rings": (60, 61), "from_deg": (-10.0, -12.0), "to_deg": (10.0, 14.0)}
    is_candidate: ClassVar = False

    rings: tuple[int, ...] = Field(min_length=1, max_length=4096, description="lasers of the sectors, 0 on top")
    from_deg: bounded(-180, 180) = Field(description="right ends of the sectors, counter-clockwise from forward [°]")  # type: ignore[valid-type]
    to_deg: bounded(-180, 180) = Field(description="left ends of the sectors [°]")  # type: ignore[valid-type]
    sigma_deg: float = Field(default=0.0, ge=0, le=10, description="σ, standard deviation of the ends of a sector [°]")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not len(self.rings) == len(self.from_deg) == len(self.to_deg):
            raise ValueError(
                f"rings, from_deg and to_deg have {len(self.rings)}, {len(self.from_deg)} and {len(self.to_deg)} "
                "entries; give one a sector"
            )
        return self

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Its parameters: columns of a table with a row per sector."""
        return tuple(
            replace(parameter, per_ring=False, is_table=True, unit="°" if parameter.name.endswith("_deg") else "")
            for parameter in super().parameters()
        )

    def check(self, pattern: Pattern) -> None:
        """Raise ValueError where a sector is of a laser that the pattern does not have."""
        if max(self.rings) >= pattern.rings or min(self.rings) < 0:
            raise ValueError(
                f"rings span {min(self.rings)} to {max(self.rings)} but {pattern.name} has {pattern.rings}"
            )

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return the returns that the vehicle does not hide."""
        low, high = np.array(self.from_deg), np.array(self.to_deg)
        shift = self.sigma_deg * rng.standard_normal((2, len(low)))
        low = np.where(low > -180, low + shift[0], low)  # sectors continue across the rear
        high = np.where(high < 180, high + shift[1], high)
        hidden = self._of_sectors(returns, shot, lambda azimuth, k: (azimuth >= low[k]) & (azimuth < high[k]))
        return returns.take(hidden == 0)

    def expected(self, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
        """Return all returns, and the probability of each that the vehicle does not hide it."""
        width = max(self.sigma_deg, 1e-6)
        low = np.array(self.from_deg) - 360.0 * (np.array(self.from_deg) <= -180)
        high = np.array(self.to_deg) + 360.0 * (np.array(self.to_deg) >= 180)
        hidden = self._of_sectors(
            returns, shot, lambda azimuth, k: ndtr((azimuth - low[k]) / width) * ndtr((high[k] - azimuth) / width)
        )
        return returns, np.maximum(1 - hidden, 0)

    def _of_sectors(self, returns: Returns, shot: Shot, share: Callable[[np.ndarray, int], np.ndarray]) -> np.ndarray:
        """Sum (m,) over the sectors of each return's laser of `share` of azimuths [°] and the sector's number."""
        ring = shot.rays.ring[returns.beam]
        total = np.zeros(len(returns))
        rows = np.argsort(ring, kind="stable")
        azimuth = np.degrees(shot.rays.azimuth[returns.beam[rows]])
        first, end = (np.searchsorted(ring[rows], self.rings, side).tolist() for side in ("left", "right"))
        for sector in range(len(self.rings)):
            of_laser = slice(first[sector], end[sector])
            total[rows[of_laser]] += share(azimuth[of_laser], sector)
        return total
