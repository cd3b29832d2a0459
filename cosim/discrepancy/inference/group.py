"""One thing that may be missing, as columns that residuals are held against."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from cosim.discrepancy.inference.columns import SparseMatrix
from cosim.discrepancy.inference.random_effects import Estimate
from cosim.discrepancy.inference.score import Quantity
from sensors.effects.base import Effect

Channel = Literal["range", "intensity", "drop", "spurious", "range_variance", "intensity_variance", "pose"]


@dataclass(frozen=True, eq=False)
class Strays:
    """Returns from nowhere that the weak form of an effect adds.

    Attributes:
        expected: (n,) how many take the place of a beam's own return, in beams of the sample.
        step: amplitude of that form.
        each: what one weighs, in beams of the sample.
        gain: log-likelihood by which the form explains one better than none does.
    """

    expected: np.ndarray
    step: float
    each: float
    gain: float


@dataclass(frozen=True, eq=False)
class Group:
    """Columns of one catalogue effect, or of a dependence that no effect is named for.

    Attributes:
        name: of the effect; or `CHANNEL by COVARIATE`.
        channel: what is off.
        columns: (n, k) by quantity: its change with a unit of each of k numbers.
        size: k.
        covariates: names of what a dependence is on; empty for effects.
        one_sided: whether only a positive amplitude makes sense.
        by_scan: whether errors that a scan shares could make it; not asked where it is about scans itself.
        start: the effect, weakly on.
        amplitude: its parameter that the column is of; empty for whole settings, and for dependences.
        label: its other parameters, for people.
        place: where the effect stands among the sensor's, if it is there already.
        gain: (n,) what the weak form adds to every beam's log-likelihood, for effects that no slope tells of.
        strays: what it adds, if it adds strays.
        begun: random effects that a fit of it starts from; those that there are by default.
    """

    name: str
    channel: str
    columns: dict[Quantity, SparseMatrix]
    size: int
    covariates: tuple[str, ...] = ()
    one_sided: bool = False
    by_scan: bool = True
    start: Effect | None = None
    amplitude: str = ""
    label: str = ""
    place: int | None = None
    gain: np.ndarray | None = None
    strays: Strays | None = None
    begun: Estimate | None = None

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect with a name."""
        return self.start is not None
