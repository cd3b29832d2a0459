"""Glass and metal mirror the scene: a ghost stands behind the façade."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.effects.reflection import mirrored_returns
from sensors.returns import Returns
from sensors.shot import Shot


class MirrorGhost(EchoEffect):
    """A share `strength` of the beams on glass or metal returns the mirrored scene at the folded range R1 + R2.

    Where the mirrored beam meets nothing within reach, the surface answers as it would have.
    """

    name: ClassVar = "mirror_ghost"
    phase: ClassVar = Phase.GHOST
    channel: ClassVar = "spurious"
    also: ClassVar = ("range", "intensity", "drop")
    equation: ClassVar = "R = R1 + R2, with probability strength on glass and metal"
    reference: ClassVar = "Zhao et al.: Mapping with reflection, SSRR 2020"
    taxonomy: ClassVar = "sp47"
    confusable_with: ClassVar = ("glass_transmission", "false_alarms")
    needs_new_rays: ClassVar = True
    example: ClassVar = {"strength": 0.5}
    neutral: ClassVar = {"strength": 0.0}

    strength: float = number("share of beams on glass or metal that are mirrored", ge=0, le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Returns with ghosts in place of those of mirrored beams."""
        chosen = rng.random(len(shot.rays)) < self.strength
        mirrors = returns.take(self._on_metal(returns, shot) & (returns.return_no == 0)).merged(shot.panes)
        mirrors = mirrors.take(chosen[mirrors.beam])
        ghosts, _ = mirrored_returns(mirrors, shot, shot.pattern.range_m[1])
        return returns.replacing_beams(ghosts)

    def expected(self, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
        """All returns; mirrored beams are taken to meet something."""
        mirrors = self._on_metal(returns, shot) | np.isin(returns.beam, shot.panes.beam)
        return returns, 1 - self.strength * mirrors

    @staticmethod
    def _on_metal(returns: Returns, shot: Shot) -> np.ndarray:
        return shot.hits.table.column("metal")[returns.material] & ~np.isin(returns.beam, shot.panes.beam)
