"""Bins of covariates that charts and scans share, so that a bin of a chart can be shown in a scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cosim.discrepancy.quantities import QuantityStyle, shown
from cosim.discrepancy.report.beams import LAYOUT, BeamColumn, Rows, ShownScan, renumbered
from cosim.report.binned import quantile_edges

NO_BIN = 255
_NUMBERED = ("ring", "scan")  # integers, one bin each


USUAL = (
    "range", "incidence", "ring", "azimuth", "intensity", "firing_time", "material", "kind", "albedo",
    "previous_intensity", "frame_time", "speed",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Bins:
    """A covariate of the rows, in bins.

    Attributes:
        name: name of the covariate.
        shown: words and unit for display.
        edges: (b − 1,) inner edges, in the covariate's unit; empty for categories.
        codes: (b,) numbers of categories, or integers; empty otherwise.
        names: names of all categories by number; empty for numbers.
        ends: smallest and largest value.
        of_rows: (n,) bin of each row; `NO_BIN` for none.
    """

    name: str
    shown: QuantityStyle
    edges: np.ndarray
    codes: np.ndarray
    names: tuple[str, ...]
    ends: tuple[float, float]
    of_rows: np.ndarray

    @classmethod
    def of(cls, rows: Rows, name: str, bins: int = LAYOUT.bins) -> Bins | None:
        """Bin a covariate of rows; None if it is absent or constant."""
        column = rows.covariates.get(name)
        known = column.values[np.isfinite(column.values)] if column is not None else np.zeros(0)
        if column is None or not len(known) or known.min() == known.max():
            return None
        edges, codes = np.zeros(0), np.zeros(0, int)
        if column.names:
            values, count = np.unique(known.astype(int), return_counts=True)
            codes = values[np.argsort(-count, kind="stable")][: LAYOUT.names]
        elif name in _NUMBERED:
            codes = np.unique(known.astype(int))[: NO_BIN - 1]
        else:
            edges = quantile_edges(known, bins)
        ends = float(known.min()), float(known.max())
        empty = cls(name, shown(name), edges, codes, column.names, ends, np.zeros(0, np.uint8))
        return cls(name, empty.shown, edges, codes, column.names, ends, empty.place(column.values))

    def __len__(self) -> int:
        return len(self.codes) if len(self.codes) else len(self.edges) + 1

    def place(self, values: np.ndarray) -> np.ndarray:
        """(n,) uint8 bin of each value."""
        known = np.isfinite(values)
        if not len(self.codes):
            return np.where(known, np.searchsorted(self.edges, np.nan_to_num(values), side="right"), NO_BIN).astype(
                np.uint8
            )
        row = np.full(int(self.codes.max()) + 2, NO_BIN, np.uint8)
        row[self.codes] = np.arange(len(self.codes))
        code = np.where(known, np.nan_to_num(values), -1).astype(int)
        return row[np.where((code >= 0) & (code < len(row)), code, len(row) - 1)]

    def of_scan(self, scan: ShownScan) -> np.ndarray:
        """(n,) uint8 bin of each beam of a scan."""
        column = scan.covariates.get(self.name)
        if column is None:
            return np.full(len(scan.measured_m), NO_BIN, np.uint8)
        return self.place(renumbered(BeamColumn(column.unit, column.values, column.names), self.names))

    def words(self) -> tuple[str, ...]:
        """Description of each bin."""
        if self.names:
            return tuple(self.names[code].replace("_", " ") for code in self.codes)
        if len(self.codes):
            return tuple(f"{self.shown.words.split(',')[0]} {code}" for code in self.codes)
        ends = self.shown.factor * np.concatenate([[self.ends[0]], self.edges, [self.ends[1]]])
        unit = f" {self.shown.unit}" if self.shown.unit not in ("", "°") else self.shown.unit
        return tuple(f"{_short(low)} to {_short(high)}{unit}" for low, high in pairwise(ends))

    @property
    def label(self) -> str:
        """Label of an axis."""
        return f"{self.shown.words} ({self.shown.unit})" if self.shown.unit else self.shown.words


def bins_of(rows: Rows, names: Sequence[str]) -> dict[str, Bins]:
    """Bins of the named covariates that are present."""
    all_bins = {name: Bins.of(rows, name) for name in names}
    return {name: bins for name, bins in all_bins.items() if bins is not None}


def _short(value: float) -> str:
    return f"{value + 0.0:.3g}".replace("-", "−") if abs(value) < 1000 else f"{value:.0f}"
