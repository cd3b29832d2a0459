"""Beam divergence: the footprint of a beam hits several surfaces at an edge.

Where parts of a footprint are farther apart than a pulse, a few samples do not determine the reported echo.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from sensors.effects.base import EchoEffect, number
from sensors.effects.phases import Phase
from sensors.effects.surfaces.footprint import directions_aside, strongest_echo
from sensors.effects.surfaces.some_footprints import footprints_of_some, ranges_between
from sensors.hits import Hits
from sensors.returns import Returns
from sensors.shot import Shot

_METRES_PER_NS = 0.299792458
ELSEWHERE_CHANCE = 0.1  # that another part of the footprint answers than the one that its samples say


class BeamDivergence(EchoEffect):
    """Five rays sample the footprint; those whose echoes lie closer than c·τ/2 merge into one.

    The strongest merged echo answers: its range is the mean weighted by signal (a mixed pixel at edges), its
    intensity the sum over the part of the footprint it fills.
    """

    name: ClassVar = "beam_divergence"
    phase: ClassVar = Phase.DIVERGENCE
    channel: ClassVar = "range"
    also: ClassVar = ("intensity", "drop")
    equation: ClassVar = "R = Σ wᵢρᵢRᵢ / Σ wᵢρᵢ over echoes closer than c·τ/2"
    reference: ClassVar = "Wagner et al.: Gaussian decomposition of full-waveform lidar, ISPRS J. 2006"
    taxonomy: ClassVar = "sp55"
    confusable_with: ClassVar = ("range_noise", "incidence_bias", "foliage_depth", "blooming")
    needs_new_rays: ClassVar = True
    by_search: ClassVar = True
    # Footprints of 7 and of 37 rays are found 6 to 16 % too narrow.
    sampled_to: ClassVar = {"divergence_mrad": 0.16, "pulse_ns": 0.16}
    example: ClassVar = {"divergence_mrad": 6.0, "pulse_ns": 6.0}
    neutral: ClassVar = {"divergence_mrad": 0.0, "pulse_ns": 6.0}
    shapes: ClassVar = tuple({"divergence_mrad": angle} for angle in (1.0, 3.0, 6.0))

    divergence_mrad: float = number("full angle of the beam", unit="mrad", ge=0, le=50)
    pulse_ns: float = number("τ, length of the pulse", unit="ns", ge=0, le=1000)

    def apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns:
        """Return returns of whole footprints."""
        if self.divergence_mrad == 0:
            return returns
        if shot.world is None or shot.beams is None:
            raise ValueError("the footprint is new rays; measure with trace_and_measure")
        radius_rad = self.divergence_mrad / 2000
        world, beams = shot.world, shot.beams

        def make() -> Hits:
            return world.trace_around(beams, lambda middle: directions_aside(middle, radius_rad), slot=slot)

        slot = f"footprint {radius_rad}"
        return strongest_echo(returns, shot.hits, shot.kept(slot, make), pulse_m=self._pulse_m)

    def expected(self, returns: Returns, shot: Shot) -> tuple[Returns, np.ndarray]:
        """Return returns of whole footprints, and the probability (m,) that no other part of them returns."""
        if not self._is_replayed(shot):
            changed = self.apply(returns, shot, np.random.default_rng(0))
            return changed, np.ones(len(changed))
        aside = self._aside(shot)
        changed = strongest_echo(returns, shot.hits, aside, pulse_m=self._pulse_m)
        _, split = self._parts(shot)
        return changed, 1 - ELSEWHERE_CHANCE * split[changed.beam]

    def density(self, beam: np.ndarray, range_m: np.ndarray, shot: Shot) -> np.ndarray:
        """Return the density of ranges of the other parts of the footprint."""
        if not self._is_replayed(shot):
            return np.zeros(len(beam))
        ranges, split = self._parts(shot)
        return density_elsewhere(ranges[beam], split[beam], range_m, self._pulse_m)

    def elsewhere(self, shot: Shot) -> np.ndarray | float:
        """Return the probability (n,) that another part of the footprint answers than its samples say."""
        return ELSEWHERE_CHANCE * self._parts(shot)[1] if self._is_replayed(shot) else 0.0

    def _is_replayed(self, shot: Shot) -> bool:
        return self.divergence_mrad > 0 and shot.is_part

    def _aside(self, shot: Shot) -> Hits:
        """Surfaces in the footprints of some beams of a revolution."""
        radius_rad = self.divergence_mrad / 2000

        def trace() -> Hits:
            return shot.joined(shot.by_frame(lambda part: footprints_of_some(part, radius_rad)))

        return shot.kept(f"footprint {radius_rad}", trace)

    def _parts(self, shot: Shot) -> tuple[np.ndarray, np.ndarray]:
        """Ranges (n, k) of parts of footprints, and which footprints (n,) bool are split.

        A thin object may be between samples that all hit the same surface; visibility and echoes both depend on it.
        """
        return shot.kept(f"parts {self.divergence_mrad} {self.pulse_ns}", lambda: self._parts_anew(shot))

    def _parts_anew(self, shot: Shot) -> tuple[np.ndarray, np.ndarray]:
        sampled = _sampled_ranges(shot.hits, self._aside(shot))
        between = np.concatenate(shot.by_frame(lambda part: ranges_between(part, self.divergence_mrad / 2000)))
        split = is_split(sampled, self._pulse_m)
        between[split] = np.inf
        parts = np.hstack([sampled, between])
        missed = ~np.isfinite(sampled).any(1) & np.isfinite(between).any(1)
        return parts, split | missed | is_split(parts, self._pulse_m)

    @property
    def _pulse_m(self) -> float:
        return self.pulse_ns * _METRES_PER_NS / 2


def _sampled_ranges(middle: Hits, aside: Hits) -> np.ndarray:
    """Ranges (n, samples) float64 of the middle of every beam and of the samples around it, as many rows a beam."""
    first = middle.solid.range_m.astype(np.float64)[:, None]
    return np.hstack([first, aside.solid.range_m.astype(np.float64).reshape(len(first), -1)])


def is_split(ranges: np.ndarray, pulse_m: float) -> np.ndarray:
    """(n,) bool: whether following ranges (n, samples) lie farther apart than pulses of c·τ/2 merge."""
    ranges = np.sort(ranges, axis=1)
    gaps = np.diff(np.where(np.isfinite(ranges), ranges, 0.0), axis=1)
    return np.any((gaps > pulse_m) & np.isfinite(ranges[:, 1:]), axis=1)


def density_elsewhere(ranges: np.ndarray, split: np.ndarray, range_m: np.ndarray, pulse_m: float) -> np.ndarray:
    """Probability per metre (n,) of an answer at `range_m` (n,) from another part of footprints.

    Their samples lie at `ranges` (n, samples); only those that are `split` (n,) have other parts to answer. Parts
    between these return echoes, too: each sample represents a section as wide as the sample distance.
    """
    there = np.isfinite(ranges)
    known = np.where(there, ranges, 0.0)
    count = np.maximum(there.sum(1), 1)
    mean = known.sum(1) / count
    spread = np.sqrt((np.where(there, known - mean[:, None], 0.0) ** 2).sum(1) / count)
    width = np.maximum(spread, pulse_m / 2)[:, None]
    each = np.exp(-0.5 * ((range_m[:, None] - known) / width) ** 2) / (np.sqrt(2 * np.pi) * width)
    return ELSEWHERE_CHANCE * split * (each * there).sum(1) / count
