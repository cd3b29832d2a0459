"""Check that a network is connected, because traffic cannot leave an isolated part."""

from __future__ import annotations

from typing import Any

import numpy as np

from sumo_nets.errors import TownError


def demand_connected(name: str, network: Any) -> None:
    """Raise `TownError` where a car cannot drive from every street to every other.

    Args:
        name: the town's, for the message.
        network: as sumolib reads it.
    """
    edges = [edge for edge in network.getEdges() if edge.allows("passenger")]
    if not edges:
        raise TownError(f"town {name!r} has no street that cars may use; give its layout some")
    piece = _pieces(edges)
    largest = np.bincount(piece).argmax()
    cut_off = [edge.getID() for edge, number in zip(edges, piece, strict=True) if number != largest]
    if cut_off:
        raise TownError(
            f"town {name!r} is disconnected: {len(cut_off)} of its {len(edges)} streets, {cut_off[0]!r} among them, "
            "cannot be reached from the others and left again; change its layout, or drop fewer streets"
        )


def _pieces(edges: list[Any]) -> np.ndarray:
    """Return the strongly connected component of every edge, by lane connections a car may use."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components

    number = {edge.getID(): i for i, edge in enumerate(edges)}
    ways = [
        (number[edge.getID()], number[target.getID()])
        for edge in edges
        for target, links in edge.getOutgoing().items()
        if target.getID() in number
        and any(link.getFromLane().allows("passenger") and link.getToLane().allows("passenger") for link in links)
    ]
    rows = np.array(ways, dtype=np.int64).reshape(-1, 2).T
    graph = csr_matrix((np.ones(len(ways)), rows), shape=(len(edges), len(edges)))
    return connected_components(graph, directed=True, connection="strong")[1]
