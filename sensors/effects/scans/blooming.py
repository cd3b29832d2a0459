"""Light of a bright reflector leaks into the receivers of neighbouring beams."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.spatial import KDTree

from sensors.effects.base import ScanEffect, number
from sensors.effects.phases import Phase
from sensors.effects.surfaces.reflection import normal_density
from sensors.returns import Returns
from sensors.shot import Shot

_LEAK = 0.3
_BLUR_M = 0.1  # of a reflector's range, by poses


class Blooming(ScanEffect):
    """Beams within `radius_deg` of a retro return above `threshold` return from there if their surface is farther.

    They report the reflector's range with 0.3 of its intensity; of several reflectors the nearest in angle is used.
    """

    name: ClassVar = "blooming"
    phase: ClassVar = Phase.BLOOMING
    channel: ClassVar = "spurious"
    also: ClassVar = ("range", "intensity", "drop")
    equation: ClassVar = "angle to a retro return (I > threshold) ≤ radius: R = R_retro, I = 0.3·I_retro"
    reference: ClassVar = "halos seen around plates and signs; equation of this catalogue"
    taxonomy: ClassVar = "re19"
    confusable_with: ClassVar = ("retroreflection", "beam_divergence")
    example: ClassVar = {"radius_deg": 1.0, "threshold": 0.7}
    neutral: ClassVar = {"radius_deg": 0.0, "threshold": 1.0}
    shapes: ClassVar = tuple(
        {"radius_deg": radius, "threshold": least} for radius in (0.4, 0.7, 1.2) for least in (0.5, 0.7)
    )

    radius_deg: float = number("radius of the halo", unit="°", ge=0, le=20)
    threshold: float = number("intensity above which a reflector blooms", ge=0, le=1)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns with halos."""
        bright = shot.is_material("retro", returns) & (returns.intensity > self.threshold)
        source, others = returns.take(bright), np.flatnonzero(~bright)
        if not len(source) or self.radius_deg == 0:
            return returns
        direction = shot.rays.direction
        chord = 2 * np.sin(np.radians(self.radius_deg) / 2)
        distance, found = KDTree(direction[source.beam]).query(
            direction[returns.beam[others]], distance_upper_bound=chord
        )
        near = np.flatnonzero(np.isfinite(distance))
        rows, nearest = others[near], np.asarray(found)[near]
        farther = returns.range_m[rows] > source.range_m[nearest]
        rows, nearest = rows[farther], nearest[farther]
        beam, first = np.unique(returns.beam[rows], return_index=True)
        glow = source.take(nearest[first])
        return returns.replacing_beams(
            Returns.spurious(beam, glow.range_m, np.float32(_LEAK) * glow.intensity, glow.material)
        )

    def survival(self, returns: Returns, shot: Shot) -> np.ndarray:
        """Return 0 for surfaces that a halo covers, else 1."""
        glow_m = self._glow(shot)[returns.beam]
        return 1.0 - (returns.range_m > glow_m)

    def density(self, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        """Return the density at the reflector's range."""
        return normal_density(range_m - self._glow(shot)[beam], _BLUR_M)

    def _glow(self, shot: Shot) -> np.ndarray:
        """Range (n,) of the reflector in whose halo each beam lies, by bare reflectance; inf where there is none."""

        def make() -> tuple[np.ndarray, np.ndarray]:
            whole = shot.whole or shot
            solids = whole.solids
            source = solids.take(whole.is_material("retro", solids) & (solids.reflectance > self.threshold))
            if not len(source):
                return np.full(len(shot.rays), np.inf), np.full(len(shot.rays), np.inf)
            chord, nearest = KDTree(whole.rays.direction[source.beam]).query(shot.rays.direction)
            return 2 * np.degrees(np.arcsin(np.minimum(chord / 2, 1))), source.range_m[nearest].astype(np.float64)

        apart_deg, range_m = shot.kept(f"reflectors above {self.threshold}", make)
        return np.where((apart_deg > 0) & (apart_deg <= self.radius_deg), range_m, np.inf)
