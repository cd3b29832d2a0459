"""Columns of a scan that unknown effects may depend on: of the beam itself, of what it meets, of its neighbours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.hidden.scan import Scan

_NO_INSTANCE_KIND = "none"


@dataclass(frozen=True)
class Column:
    """A covariate.

    Attributes:
        of: scan → (n,) values.
        low, high: between these most beams lie.
        accepted: names that say the same of the same data.
    """

    of: Callable[[Scan], np.ndarray]
    low: float
    high: float
    accepted: tuple[str, ...]

    def unit(self, scan: Scan) -> np.ndarray:
        """(n,) values, 0 at `low` and 1 at `high`."""
        return (self.of(scan) - self.low) / (self.high - self.low)


def incidence(scan: Scan) -> np.ndarray:
    """(n,) angle between beam and surface normal [rad]."""
    return np.arccos(np.clip(scan.cos, 0, 1))


def measured_intensity(scan: Scan) -> np.ndarray:
    """(n,) intensity, 0 without a return."""
    return np.where(scan.found, np.clip(scan.intensity, 0, 1), 0.0)


def firing(scan: Scan) -> np.ndarray:
    """(n,) number of the firing in the revolution."""
    return np.tile(np.arange(scan.beams.firings), scan.beams.rings)


def neighbour(scan: Scan, values: np.ndarray, which: str, missing: float) -> np.ndarray:
    """(n,) values of the beam `above` or `below` in the same firing, or of the same laser's `previous` firing.

    Args:
        scan: gives the grid.
        values: (n,).
        which: of the three.
        missing: for beams that have no such neighbour.
    """
    grid = values.reshape(scan.beams.rings, scan.beams.firings)
    moved = np.full(grid.shape, missing, float)
    if which == "above":
        moved[1:] = grid[:-1]
    elif which == "below":
        moved[:-1] = grid[1:]
    else:
        moved[:, 1:] = grid[:, :-1]
    return moved.ravel()


def kind(scan: Scan) -> np.ndarray:
    """(n,) kind of road user that answers, `none` for the static world."""
    types = np.array([*(thing["kind"] for thing in scan.frame["instances"]), _NO_INSTANCE_KIND, _NO_INSTANCE_KIND])
    return types[scan.instance]  # −1 and −2 are the last two


def made_of(scan: Scan, materials: tuple[str, ...]) -> np.ndarray:
    """(n,) bool: one of these materials answers."""
    rows = np.isin(scan.table.names, materials)
    return rows[scan.material] & (scan.material >= 0)


COLUMNS: dict[str, Column] = {
    "range": Column(lambda scan: scan.range_m, 3.0, 40.0, ("range",)),
    "incidence": Column(incidence, 0.0, np.pi / 2, ("incidence",)),
    "elevation": Column(lambda scan: np.degrees(scan.beams.elevation), -25.0, 2.0, ("elevation", "ring")),
    "azimuth": Column(lambda scan: scan.beams.azimuth, -np.pi, np.pi, ("azimuth", "firing_time")),
    "ring": Column(lambda scan: scan.beams.ring / scan.beams.rings, 0.0, 1.0, ("ring", "elevation")),
    "albedo": Column(lambda scan: scan.rho, 0.0, 0.8, ("albedo", "material", "intensity")),
    "intensity": Column(measured_intensity, 0.0, 0.8, ("intensity", "albedo", "material")),
    "previous_intensity": Column(
        lambda scan: neighbour(scan, measured_intensity(scan), "previous", 0.0), 0.0, 0.8, ("previous_intensity",)
    ),
}
