"""The numbers that decide in a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """Numbers that decide; each was chosen on drives of town02, which no benchmark uses, unless a source is named.

    Attributes:
        rows: beams of a sample; more make a diagnosis slower, and hardly surer, as clusters decide.
        level: family-wise error rate of every test; the convention of the field.
        draws: sign patterns of a wild bootstrap; 1999 tell p to 0.0005.
        most_findings: effects and unknowns that are added at most.
        fitted_candidates: catalogue effects that are fitted a round, the best by foreseen gain.
        nearly: share of the best candidate's foreseen gain from which another one is fitted, too.
        alike_sigmas: standard errors of a difference of gains below which two candidates cannot be told apart.
        edge_sigmas: standard deviations of pose and object errors by which edges are widened.
        sharp_m, sharp_rad: spreads of poses and objects below which edges are as sharp as they were traced.
        turned_rad, shifted_m: by how much a beam may have moved from where it was traced.
        pose_shift_m, pose_turn_rad: spread of pose errors that a fit starts from.
        variance_sigmas: standard errors that a random effect's variance must be above 0 to be kept.
        bins: of a covariate when it is screened; equal numbers of beams in each.
        fewest_in_bin: beams; fewer tell nothing of a bin.
        coverage: of intervals.
        grazing: cosine of incidence below which a beam runs along a surface rather than to it.
        power: deviate that 80 % power adds to a critical value, the 80 % quantile of a normal law.
        at_floor: share by which an error may stand above its floor and still be at it.
    """

    rows: int = 30_000
    level: float = 0.05
    draws: int = 1999
    most_findings: int = 8
    fitted_candidates: int = 4
    nearly: float = 0.4
    alike_sigmas: float = 1.0
    edge_sigmas: float = 3.5
    sharp_m: float = 2e-3
    sharp_rad: float = 1e-4
    turned_rad: float = 7e-4
    shifted_m: float = 0.02
    pose_shift_m: float = 0.02
    pose_turn_rad: float = 9e-4
    variance_sigmas: float = 3.0
    bins: int = 10
    fewest_in_bin: int = 150
    coverage: float = 0.95
    grazing: float = 0.02
    power: float = 0.84
    at_floor: float = 0.05

    @property
    def upper(self) -> float:
        """Where intervals end above, as a quantile."""
        return (1 + self.coverage) / 2


DEFAULT = Settings()
