"""Groups of columns: one hypothesis each about what a model lacks."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from cosim.discrepancy.dictionary.covariates import Covariate
from cosim.discrepancy.dictionary.linearisation import Linearisation
from cosim.discrepancy.inference.dependence import ANGLES, SPREADS, SPURIOUS
from cosim.discrepancy.inference.score import QUANTITIES, Quantity, SparseMatrix, scaled
from sensors.effects.base import Effect


@dataclass(frozen=True, eq=False)
class Tangent:
    """A catalogue effect at one setting of its shape, weakly on.

    Attributes:
        effect: with its amplitude at `step`.
        amplitude: name of the parameter that the columns are derivatives with respect to; empty for whole settings.
        step: of the amplitude from its neutral value.
        index: place of the effect in the sensor, if it has the effect already.
    """

    effect: Effect
    amplitude: str
    step: float
    index: int | None = None


@dataclass(frozen=True, eq=False)
class Group:
    """One hypothesis: a channel that depends on covariates, or an effect of the catalogue.

    Attributes:
        name: of the effect with its setting, or `CHANNEL by COVARIATE`.
        channel: that changes.
        covariates: names; empty for effects.
        size: number of columns k.
        columns: (n, k) derivatives by quantity; empty where `direct` holds scores.
        basis: (n, k) basis functions of a dependence, of which the columns are multiples.
        covariate: of a dependence on bins, so that it can be refined.
        kept: (k,) which bins of the covariate the columns are.
        one_sided: whether only positive coefficients make sense.
        is_clustered_by_scan: whether parts of scans are clusters, too; not for what differs from scan to scan.
        is_count: whether score and information count events.
        direct: score and information (n,) of one column that no derivative gives.
        tangent: of an effect.
        frequency_hz: of a periodic dependence in absolute time; 0 for others.
    """

    name: str
    channel: str
    covariates: tuple[str, ...]
    size: int
    columns: dict[Quantity, SparseMatrix] = field(default_factory=dict)
    basis: SparseMatrix | None = None
    covariate: Covariate | None = None
    kept: np.ndarray | None = None
    one_sided: bool = False
    is_clustered_by_scan: bool = True
    is_count: bool = False
    direct: tuple[np.ndarray, np.ndarray] | None = None
    tangent: Tangent | None = None
    frequency_hz: float = 0.0

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect with a name."""
        return self.tangent is not None

    @property
    def is_shared(self) -> bool:
        """Whether it is the variance of an error that the beams of a unit share."""
        return self.channel.startswith("shared_")

    @property
    def order(self) -> int:
        """Order in which groups are added: laws, phases of their own in each scan, shared errors, neighbours.

        Errors that a unit shares, and dependences on what neighbouring beams measured, contain the effect of every law
        that neighbours have in common; neighbours also show every error that a unit shares.
        """
        if self.is_of_neighbour:
            return 3
        if self.is_shared:
            return 2
        return 0 if self.is_clustered_by_scan else 1

    @property
    def is_of_neighbour(self) -> bool:
        """Whether it depends on what neighbouring beams measured."""
        return self.covariate is not None and self.covariate.is_of_neighbour

    @property
    def effect_name(self) -> str:
        """Name of the effect; empty for dependences."""
        return self.tangent.effect.name if self.tangent else ""

    @property
    def hypothesis(self) -> str:
        """Name of the effect, whatever its setting, or of the dependence."""
        return self.effect_name or self.name

    @property
    def family(self) -> str:
        """What it changes: range, intensity or returns."""
        name = self.channel.removeprefix("shared_")
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
    covariate: Covariate | None = None,
    kept: np.ndarray | None = None,
    is_clustered_by_scan: bool = True,
    frequency_hz: float = 0.0,
) -> Group:
    """A dependence of a channel on basis functions (n, k)."""
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


def binned_group(linearisation: Linearisation, channel: str, covariate: Covariate, fewest: int) -> Group | None:
    """A channel by the bins of a covariate that at least `fewest` informative beams are in; None without enough bins.

    A constant, and the mean of each class of objects, need one bin; others two.
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


def is_asked(channel: str, covariate: Covariate) -> bool:
    """Whether a channel is tested against a covariate.

    Not where the covariate holds the beam's own noise or the same cloud of points, nor where a pose or a deflected beam
    cannot depend on what it meets.
    """
    if covariate.is_of_neighbour:
        if channel in SPREADS or channel in SPURIOUS or channel in ANGLES:
            return False
        return channel != "drop" or covariate.name.endswith("_lost")
    return channel not in ANGLES or covariate.name not in ("material", "model", "kind", "albedo", "intensity")


def joined(groups: list[Group], rows: int) -> dict[Quantity, SparseMatrix]:
    """Columns (n, sum of sizes) of several groups, by quantity."""
    found: dict[Quantity, SparseMatrix] = {}
    for name in QUANTITIES:
        if any(name in group.columns for group in groups):
            parts = [group.columns.get(name, sparse.csr_matrix((rows, group.size))) for group in groups]
            found[name] = sparse.hstack(parts, format="csr")
    return found
