"""Values of channels, and the samples in which they are taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.driver_discrepancy.placed import Placed

MOVES_MPS, RESTS_MPS = 0.5, 0.1
CLEAR_OF_ENDS_M = 12.0


@dataclass(frozen=True, eq=False)
class Values:
    """Values of a channel.

    Attributes:
        rows: (m,) samples at which they were taken.
        values: (m,) in the channel's unit.
        weights: (m,) exposure; for events per exposure, values are counts of weight 0 and exposure has value 0.
    """

    rows: np.ndarray
    values: np.ndarray
    weights: np.ndarray

    @classmethod
    def at(cls, chosen: np.ndarray, values: np.ndarray, weights: np.ndarray | float = 1.0) -> Values:
        """Those of a mask (n,) of samples."""
        rows = np.flatnonzero(chosen & np.isfinite(values))
        weight = np.broadcast_to(np.asarray(weights, float), values.shape)[rows]
        return cls(rows, values[rows], weight)

    @classmethod
    def per_exposure(cls, events: np.ndarray, exposed: np.ndarray, each: float) -> Values:
        """Events (rows) per exposure: so much for each sample of a mask."""
        rows = np.flatnonzero(exposed)
        return cls(
            np.concatenate([events, rows]),
            np.concatenate([np.ones(len(events)), np.zeros(len(rows))]),
            np.concatenate([np.zeros(len(events)), np.full(len(rows), each)]),
        )


def on_street(placed: Placed) -> np.ndarray:
    """Samples (n,) of driving vehicles outside junctions."""
    return placed.on & ~placed.parked & (placed.of_lane(lambda _, lane: float(lane.inside)) == 0)


def street_entries(placed: Placed) -> tuple[np.ndarray, list[str]]:
    """Samples (m,) with which vehicles enter an edge outside junctions, and those edges."""
    lanes = placed.network.lanes
    edge_of = [lanes[name].edge if name in lanes and not lanes[name].inside else "" for name in placed.lanes]
    number = {edge: at for at, edge in enumerate(sorted(set(edge_of)))}
    code = np.array([number[edge] if edge else -1 for edge in edge_of], int)[placed.code]
    rows = np.flatnonzero((code >= 0) & ~placed.parked)
    new = np.ones(len(rows), bool)
    new[1:] = (np.diff(placed.tracks.vehicle[rows]) != 0) | (np.diff(code[rows]) != 0)
    rows = rows[new]
    return rows, [edge_of[at] for at in placed.code[rows].tolist()]


def inside_entries(placed: Placed) -> np.ndarray:
    """Samples with which vehicles enter a lane inside a junction."""
    inside = placed.of_lane(lambda _, lane: float(lane.inside)) > 0
    rows = np.flatnonzero(inside)
    rows = rows[rows > 0]
    new = (placed.code[rows] != placed.code[rows - 1]) & (
        placed.tracks.vehicle[rows] == placed.tracks.vehicle[rows - 1]
    )
    return rows[new]
