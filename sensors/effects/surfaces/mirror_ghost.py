"""Specular reflection on glass and metal: mirror images of the scene behind façades."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.effects.surfaces.reflection import mirrored_returns, normal_density
from sensors.returns import Returns
from sensors.shot import Shot

_BLUR_M = 0.1  # of images, by poses and by how flat the mirror is


class MirrorGhost(EchoEffect):
    """A share `strength` of the beams on glass or metal returns the mirrored scene at the folded range R1 + R2.

    If the mirrored beam hits nothing within the maximum range, the surface returns as usual.
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
        """Return returns with mirror images instead of those of mirrored beams."""
        chosen = rng.random(len(shot.rays)) < self.strength
        mirrors = returns.take(self._on_metal(returns, shot) & (returns.return_no == 0)).merged(shot.panes)
        mirrors = mirrors.take(chosen[mirrors.beam])
        ghosts, _ = mirrored_returns(mirrors, shot, shot.pattern.range_m[1])
        return returns.replacing_beams(ghosts)

    def expected(self, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
        """Return all returns, and their probabilities of not being mirrored."""
        return returns, 1 - self.strength * np.isin(returns.beam, self._images(shot).beam)

    def elsewhere(self, shot: Shot) -> np.ndarray | float:
        """Return the probability (n,) of an answer of the mirrored scene."""
        return self.strength * np.isin(np.arange(len(shot.rays)), self._images(shot).beam)

    def density(self, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        """Return the density of ranges of the mirrored scene."""
        images = self._images(shot)
        image_m = np.full(len(shot.rays), np.inf)
        image_m[images.beam] = images.range_m
        return self.strength * normal_density(range_m - image_m[beam], _BLUR_M)

    def _images(self, shot: Shot) -> Returns:
        """Mirror images that all beams on glass or metal would see."""

        def make() -> Returns:
            metal = shot.solids.take(self._on_metal(shot.solids, shot))
            return mirrored_returns(metal.merged(shot.panes), shot, shot.pattern.range_m[1])[0]

        return shot.kept("mirror images", make)

    @staticmethod
    def _on_metal(returns: Returns, shot: Shot) -> np.ndarray:
        return shot.hits.table.column("metal")[returns.material] & ~np.isin(returns.beam, shot.panes.beam)
