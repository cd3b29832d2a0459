"""Poses of parked vehicles."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from cosim.traffic.actors import Actors
from cosim.traffic.behaviour import BehaviourConfig
from cosim.traffic.behaviour.roads import Lane, Roads
from cosim.traffic.driven_traffic import DrivenTraffic
from cosim.traffic.motion import overlaps
from cosim.traffic.simulation import Traffic
from sumo_nets import read_town
from tests.cosim.inspector import centres


class Kerb:
    """Parked vehicles, their lanes and their poses."""

    def __init__(self, config: BehaviourConfig, town: str = "town01") -> None:
        with Traffic(read_town(town).sumocfg, seed=1) as traffic:
            living = DrivenTraffic(traffic, config, seed=1)
            roads = Roads(traffic.api)
            self.actors: Actors = living.advance(15)
            self.rows = np.flatnonzero(self.actors.parked)
            stops = [traffic.api.vehicle.getStops(self.actors.ids[row], 1)[0] for row in self.rows]
            self.lanes: list[Lane] = [roads.lanes[stop.lane] for stop in stops]

    def yaw_deg(self) -> np.ndarray:
        """Headings against the lane's."""
        yaws = []
        for row, lane in zip(self.rows, self.lanes, strict=True):
            at, _ = lane.project(centres(self.actors)[row])
            yaws.append(self.actors.heading_rad[row] - lane.point(at)[1])
        return np.degrees((np.array(yaws) + np.pi) % (2 * np.pi) - np.pi)

    def corners_left_m(self) -> np.ndarray:
        """Distance by which the corner nearest to the lane extends into it; negative outside."""
        over = []
        for row, lane in zip(self.rows, self.lanes, strict=True):
            heading, (length, width) = self.actors.heading_rad[row], self.actors.size[row, :2] / 2
            forward = np.array([np.cos(heading), np.sin(heading)])
            left = np.array([-forward[1], forward[0]])
            corners = [
                centres(self.actors)[row] + a * length * forward + b * width * left for a in (1, -1) for b in (1, -1)
            ]
            over.append(max(lane.project(corner)[1] for corner in corners) + lane.width_m / 2)
        return np.array(over)


@pytest.fixture(scope="module", params=["paper", "reference"])
def kerb(request) -> tuple[str, Kerb]:
    return request.param, Kerb(BehaviourConfig(preset=request.param))


def test_they_turn_as_configured(kerb):
    preset, parked = kerb
    law = stats.uniform(-8, 16) if preset == "reference" else stats.truncnorm(-4 / 1.5, 4 / 1.5, 0, 1.5)
    assert stats.kstest(parked.yaw_deg(), law.cdf).pvalue > 0.01


def test_none_reaches_into_the_lane_or_another(kerb):
    _, parked = kerb
    assert parked.corners_left_m().max() < 0.0
    actors, rows = parked.actors, parked.rows
    assert not len(overlaps(centres(actors)[rows], actors.heading_rad[rows], actors.size[rows]).first)


def test_those_of_the_reference_stand_three_to_six_metres_apart_in_their_bays():
    straight = BehaviourConfig(preset="reference", parked_yaw_deg={"kind": "constant", "value": 0})
    parked, gaps = Kerb(straight), []
    by_lane: dict[str, list[tuple[float, float]]] = {}
    for row, lane in zip(parked.rows, parked.lanes, strict=True):
        at = lane.project(parked.actors.front[row, :2])[0]
        by_lane.setdefault(lane.id, []).append((at, float(parked.actors.size[row, 0])))
    for subset in by_lane.values():
        subset.sort()
        gaps += [ahead - length - behind for (behind, _), (ahead, length) in pairwise(subset)]
    gaps = np.array(gaps)
    assert gaps.min() > 2.65  # along the lane: the strip outside a bend of 20 m is longer by 13 %
    assert np.mean(gaps < 6.1) > 0.5  # the rest are driveways


def test_cars_in_slanted_lots_keep_the_angle_of_their_lots_and_stay_off_the_lane():
    slanted = {lot.id for lot in read_town("town04").lots if lot.is_slanted}
    assert slanted
    parked = Kerb(BehaviourConfig(), "town04")
    askew = np.abs(parked.yaw_deg()) > 30
    assert askew.sum() > 20
    assert np.allclose(parked.yaw_deg()[askew], -60, atol=3)
    assert parked.corners_left_m()[askew].max() < 0.02
