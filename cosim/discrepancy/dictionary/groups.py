"""Groups of columns: each is one hypothesis about a missing effect or dependence."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from cosim.discrepancy.candidates import unknowns
from cosim.discrepancy.dictionary.covariates import SampleCovariate
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.inference.dependence import ANGLES, SPREADS, SPURIOUS
from cosim.discrepancy.inference.score import QUANTITIES, Quantity, SparseMatrix, scaled
from sensors.effects.base import Effect

# In the order of cause: a misplaced surface also changes intensities, spurious returns and losses, and a weak intensity
# losses.
FAMILIES = ("range", "intensity", "returns")
_NEGLIGIBLE = 0.01  # share of a column's sum of squares that others leave


@dataclass(frozen=True, eq=False)
class Tangent:
    """A catalogue effect with a small amplitude and one setting of its shape parameters.

    Attributes:
        effect: effect with its amplitude at `step`.
        amplitude: parameter that the columns are derivatives of; empty for effects without amplitude.
        step: difference of the amplitude from its neutral value.
        index: index of the effect in the sensor if the sensor already has it.
    """

    effect: Effect
    amplitude: str
    step: float
    index: int | None = None


@dataclass(frozen=True, eq=False)
class Group:
    """One hypothesis: a channel that depends on covariates, or an effect of the catalogue.

    Attributes:
        name: effect with its parameters, or `CHANNEL by COVARIATE`.
        channel: channel that changes.
        covariates: names of covariates; empty for effects.
        size: number of columns k.
        columns: (n, k) derivatives by quantity; empty where `direct` holds scores.
        basis: (n, k) basis functions of a dependence; the columns are multiples of them.
        covariate: covariate of a dependence on bins, used for refinement.
        kept: (k,) int bin of the covariate for each column.
        one_sided: whether only positive coefficients make sense.
        is_clustered_by_scan: whether parts of scans are clusters too; not for dependences that differ between scans.
        is_count: whether score and information count events.
        direct: score and information (n,) of a single column, if they are not computed from a derivative.
        tangent: tangent of an effect; None for dependences.
        frequency_hz: frequency of a periodic dependence in absolute time [Hz]; 0 for others.
    """

    name: str
    channel: str
    covariates: tuple[str, ...]
    size: int
    columns: dict[Quantity, SparseMatrix] = field(default_factory=dict)
    basis: SparseMatrix | None = None
    covariate: SampleCovariate | None = None
    kept: np.ndarray | None = None
    one_sided: bool = False
    is_clustered_by_scan: bool = True
    is_count: bool = False
    direct: tuple[np.ndarray, np.ndarray] | None = None
    tangent: Tangent | None = None
    frequency_hz: float = 0.0

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect of the catalogue."""
        return self.tangent is not None

    @property
    def parameters(self) -> int:
        """Number of parameters of an exact refit: all those of an effect, one for each column of a dependence."""
        if self.tangent is None:
            return self.size
        return max(self.size, sum(unknown.rings for unknown in unknowns(type(self.tangent.effect))))

    def is_special_case_of(self, other: Group) -> bool:
        """Whether another group has more columns, of which linear combinations are the columns of this one."""
        if other.size <= self.size or not self.columns or not self.columns.keys() <= other.columns.keys():
            return False
        own: SparseMatrix = sparse.vstack([self.columns[quantity] for quantity in self.columns])
        wider: SparseMatrix = sparse.vstack([other.columns[quantity] for quantity in self.columns])
        if wider.shape[0] != own.shape[0]:  # of different samples
            return False
        moment = (wider.T @ own).toarray()
        explained = (moment * np.linalg.lstsq((wider.T @ wider).toarray(), moment, rcond=None)[0]).sum(0)
        return bool((explained > (1 - _NEGLIGIBLE) * own.power(2).sum(0)).all())

    @property
    def is_shared(self) -> bool:
        """Whether it is the variance of an error that is common to the beams of a unit."""
        return self.channel.startswith("shared_")

    @property
    def order(self) -> int:
        """Order of adding groups: 0 effects and dependences, 1 phases per scan, 2 shared errors, 3 neighbours.

        Shared errors and dependences on measurements of neighbouring beams also fit any effect that neighbours have in
        common; dependences on neighbours also fit any shared error.
        """
        if self.is_of_neighbour:
            return 3
        if self.is_shared:
            return 2
        return 0 if self.is_clustered_by_scan else 1

    @property
    def is_of_neighbour(self) -> bool:
        """Whether it is a dependence on measurements of neighbouring beams."""
        return self.covariate is not None and self.covariate.is_of_neighbour

    @property
    def is_of_scan(self) -> bool:
        """Whether it is a dependence on what all beams of a scan have in common: whole scans are its clusters."""
        return self.covariate is not None and self.covariate.is_of_scan

    @property
    def turns_beams(self) -> bool:
        """Whether it changes the directions of beams."""
        return self.channel in ANGLES or (self.tangent is not None and self.tangent.effect.stage == "beam")

    @property
    def effect_name(self) -> str:
        """Name of the effect; empty for dependences."""
        return self.tangent.effect.name if self.tangent else ""

    @property
    def hypothesis(self) -> str:
        """Name of the effect without its parameters, or of the dependence."""
        return self.effect_name or self.name

    @property
    def family(self) -> str:
        """Family of the channel: one of `FAMILIES`."""
        return family_of(self.channel)


def family_of(channel: str) -> str:
    """Family of a channel, or of the errors of a channel that beams share: one of `FAMILIES`."""
    name = channel.removeprefix("shared_")
    if name.startswith("intensity"):
        return "intensity"
    return "returns" if name in ("drop", *SPURIOUS) else "range"


def basis_group(
    linearisation: Linearisation,
    channel: str,
    name: str,
    covariates: tuple[str, ...],
    basis: SparseMatrix,
    *,
    covariate: SampleCovariate | None = None,
    kept: np.ndarray | None = None,
    is_clustered_by_scan: bool = True,
    frequency_hz: float = 0.0,
) -> Group:
    """Build the group of a channel that depends on basis functions (n, k)."""
    of = linearisation.channels[channel]
    weight = np.where(linearisation.evidence.information[of.quantity] > 0, of.slope, 0.0)
    return Group(
        name,
        channel,
        covariates,
        basis.shape[1],
        {of.quantity: scaled(basis, weight)},
        basis,
        covariate,
        kept,
        of.one_sided,
        is_clustered_by_scan,
        channel in SPURIOUS,
        frequency_hz=frequency_hz,
    )


def binned_group(linearisation: Linearisation, channel: str, covariate: SampleCovariate, fewest: int) -> Group | None:
    """Build the group of a channel by the bins of a covariate with at least `fewest` informative beams.

    Returns None without enough bins: one for a constant or the mean of a class of objects, two for others.
    """
    _, information = linearisation.weights(channel)
    count = covariate.basis.T @ (information > 0).astype(float)
    kept = np.flatnonzero(count >= fewest)
    if len(kept) < (1 if covariate.name in ("kind", "constant") else 2):
        return None
    name = channel if covariate.name == "constant" else f"{channel} by {covariate.name}"
    return basis_group(
        linearisation, channel, name, covariate.names, covariate.basis[:, kept].tocsr(), covariate=covariate, kept=kept
    )


def is_tested(channel: str, covariate: SampleCovariate) -> bool:
    """Whether a channel is tested against a covariate.

    Excluded: covariates that contain the beam's own noise or the same spurious returns, and angle errors by properties
    of the surface that is hit.
    """
    if covariate.is_of_neighbour:
        if channel in SPREADS or channel in SPURIOUS or channel in ANGLES:
            return False
        return channel != "drop" or covariate.name.endswith("_lost")
    return channel not in ANGLES or covariate.name not in ("material", "model", "kind", "albedo", "intensity")


def joined(groups: list[Group], rows: int) -> dict[Quantity, SparseMatrix]:
    """Concatenate the columns of several groups by quantity: (n, sum of sizes)."""
    found: dict[Quantity, SparseMatrix] = {}
    for name in QUANTITIES:
        if any(name in group.columns for group in groups):
            parts = [group.columns.get(name, sparse.csr_matrix((rows, group.size))) for group in groups]
            found[name] = sparse.hstack(parts, format="csr")
    return found
