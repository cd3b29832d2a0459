"""Stop lines: ends of lanes at controlled junctions."""

from __future__ import annotations

from typing import Any, Literal

from assets.streets import StopLine
from sumo_nets.lanes import points, use_of
from sumo_nets.polyline import heading


def stop_lines(edge: Any) -> list[StopLine]:
    """Return the stop lines of a sumolib edge's driving lanes.

    A street yields where each of its movements, except U-turns, gives way to another street's traffic; one of lower
    priority than another street there, where any does. So a main road has no line although its left turns wait for
    oncoming traffic, nor has a street that only yields to a crossing, nor one where the right goes before the left.
    """
    if edge.getFunction():
        return []
    lanes = [lane for lane in edge.getLanes() if use_of(edge, lane) == "drive"]
    links = {lane: [link for link in lane.getOutgoing() if link.getDirection() != "t"] for lane in lanes}
    held = _control(edge, [link for lane in lanes for link in links[lane]])
    lines = []
    for lane in lanes:
        control = "signal" if any(link.getTLSID() for link in links[lane]) else held
        if control and links[lane]:
            centre = points(lane.getShape3D())
            lines.append(StopLine(lane.getID(), centre[-1], heading(centre), control))
    return lines


def _control(edge: Any, links: list[Any]) -> Literal["stop", "yield"] | None:
    states = {link.getState() for link in links}
    if states & {"s", "w"}:
        return "stop"
    if "m" not in states or states & {"M", "="}:
        return None
    node = edge.getToNode()
    others = [link for link in node.getConnections() if _comes_from_another_street(link, edge)]
    gives_way = [any(node.forbids(other, link) for other in others) for link in links]
    minor = any(other.getFrom().getPriority() > edge.getPriority() for other in others)
    return "yield" if (any(gives_way) if minor else all(gives_way)) else None


def _comes_from_another_street(link: Any, edge: Any) -> bool:
    other = link.getFrom()
    drives = use_of(other, link.getFromLane()) == "drive" and not other.getFunction()
    return drives and other is not edge and link.getDirection() != "t"
