"""Every way across every junction is one that a car can drive."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

from cosim.traffic.motion.bicycle import BicycleState, follow
from cosim.traffic.motion.chassis import Chassis
from cosim.traffic.motion.corners import corner_speed
from sumo_nets import TOWNS, read_town

STEP_S = 0.1
LENGTH_M = 4.3
STRAIGHT_M = 12.0
FASTEST_MPS = 10.0
QUICK = ("town03", "town05", "town06")  # random, wide grid, ring road


def ways_across(net: Path) -> dict[str, np.ndarray]:
    """Lane → middle line (k, 2) of the lanes in junctions that cars drive on, except U-turns."""
    root = ET.parse(net).getroot()
    round_about = {link.get("via") for link in root.findall("connection") if link.get("dir") == "t"}
    lanes = [lane for edge in root.findall("edge") if edge.get("function") == "internal" for lane in edge]
    return {
        lane.get("id", ""): np.array([p.split(",")[:2] for p in lane.get("shape", "").split()], float)
        for lane in lanes
        if lane.get("allow") != "pedestrian" and lane.get("id") not in round_about
    }


def prolonged(line: np.ndarray) -> np.ndarray:
    """A line with straights before and behind it."""
    ends = [line[0] - line[1], line[-1] - line[-2]]
    before, behind = (end / np.linalg.norm(end) * STRAIGHT_M for end in ends)
    return np.vstack([line[0] + before, line, line[-1] + behind])


class Course:
    """A line to be driven along at one speed."""

    def __init__(self, line: np.ndarray) -> None:
        self.line = prolonged(line)
        self.speed_mps = min(corner_speed(self.line), FASTEST_MPS)
        self._way = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(self.line, axis=0).T))])

    def at(self, way_m: float) -> np.ndarray:
        """The place (2,) after some way; both ends go on straight."""
        over = max(way_m - self._way[-1], 0.0) + min(way_m, 0.0)
        end = self.line[-1] - self.line[-2] if over > 0 else self.line[1] - self.line[0]
        position = np.array([np.interp(way_m, self._way, self.line[:, i]) for i in (0, 1)])
        return position + over * end / np.linalg.norm(end)

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return self._way[-1] / self.speed_mps


def angle(vectors: np.ndarray) -> np.ndarray:
    return np.arctan2(vectors[:, 1], vectors[:, 0])


def drive(courses: list[Course]) -> tuple[np.ndarray, np.ndarray]:
    """How far cars get off their courses at most (n,) [m], and by how much they turn in a step (n,) [degrees]."""
    speed = np.array([course.speed_mps for course in courses])
    before = np.array([course.at(0) for course in courses])
    heading = angle(before - np.array([course.at(-1.0) for course in courses]))
    chassis = Chassis.of(("car",) * len(courses), np.full(len(courses), LENGTH_M))
    state = BicycleState(before, heading, np.zeros(len(courses)), speed)
    off, turned = np.zeros(len(courses)), np.zeros(len(courses))
    for step in range(1, int(max(course.seconds for course in courses) / STEP_S)):
        ways = speed * step * STEP_S
        target = np.array([course.at(way) for course, way in zip(courses, ways, strict=True)])
        tail = np.array([course.at(way - LENGTH_M) for course, way in zip(courses, ways, strict=True)])
        last = state.heading_rad
        state = follow(state, chassis, target, angle(target - tail), angle(target - before), STEP_S)
        turned = np.maximum(turned, np.abs((state.heading_rad - last + np.pi) % (2 * np.pi) - np.pi))
        off = np.maximum(off, np.hypot(*(state.front - target).T))
        before = target
    return off, np.degrees(turned)


@pytest.mark.parametrize("name", [t if t in QUICK else pytest.param(t, marks=pytest.mark.slow) for t in TOWNS])
def test_a_car_can_follow_every_way_across_every_junction(name):
    ways = ways_across(read_town(name).net)
    off, turned = drive([Course(line) for line in ways.values()])
    worst = int(np.argmax(off))
    assert off[worst] < 0.4, f"{list(ways)[worst]}: {off[worst]:.2f} m"
    assert turned.max() < 6
