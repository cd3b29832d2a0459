"""Silhouette of the sensor's own vehicle, by laser."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from sensors.effects.base import EchoEffect, Parameter, bounded
from sensors.effects.phases import Phase
from sensors.pattern import Pattern
from sensors.returns import Returns
from sensors.shot import Shot


class OwnSilhouette(EchoEffect):
    """Beams of laser `rings[k]` between the azimuths `from_deg[k]` and `to_deg[k]` meet the own vehicle and are lost.

    `own_shadow` is the same with rectangles. A measured silhouette has curved bars with the world beyond them.
    """

    name: ClassVar = "own_silhouette"
    phase: ClassVar = Phase.DROPOUT
    channel: ClassVar = "drop"
    equation: ClassVar = "lost where ring = rings[k] and from_deg[k] ≤ azimuth < to_deg[k]"
    reference: ClassVar = "silhouette of the vehicle in KITTI's scans: the same beams are lost in all of them"
    taxonomy: ClassVar = "sp9"
    confusable_with: ClassVar = ("random_dropout", "own_shadow")
    example: ClassVar = {"rings": (60, 61), "from_deg": (-10.0, -12.0), "to_deg": (10.0, 14.0)}
    is_candidate: ClassVar = False

    rings: tuple[int, ...] = Field(min_length=1, max_length=4096, description="lasers of the sectors, 0 on top")
    from_deg: bounded(-180, 180) = Field(description="right ends of the sectors, counter-clockwise from forward [°]")  # type: ignore[valid-type]
    to_deg: bounded(-180, 180) = Field(description="left ends of the sectors [°]")  # type: ignore[valid-type]

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
        ring = shot.rays.ring[returns.beam]
        rows = np.flatnonzero(np.isin(ring, self.rings))
        azimuth = np.degrees(shot.rays.azimuth[returns.beam[rows]])
        hidden = np.zeros(len(rows), bool)
        for laser, low, high in zip(self.rings, self.from_deg, self.to_deg, strict=True):
            hidden |= (ring[rows] == laser) & (azimuth >= low) & (azimuth < high)
        kept = np.ones(len(returns), bool)
        kept[rows] = ~hidden
        return returns.take(kept)
