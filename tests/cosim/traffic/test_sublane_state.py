"""Simulations that continue from a saved state do not depend on the content of unused memory."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from cosim.traffic.starting import SavedState, drop_speed_advice
from cosim.traffic.warm_up import WarmUp
from sumo_nets import read_town

_TOWN = "town02"
_SIMULATE = """
import sys
from pathlib import Path
from cosim.traffic.simulation import Traffic
from cosim.traffic.starting import SavedState
from sumo_nets import read_town
town, path, time_s = sys.argv[1:]
with Traffic(read_town(town).sumocfg, 1, state=SavedState(Path(path), float(time_s))) as traffic:
    for _ in range(3):
        actors = traffic.step()
        print(actors.ids, actors.front.tolist(), actors.speed_mps.tolist())
"""


@pytest.fixture(scope="module")
def state(tmp_path_factory) -> SavedState:
    """A saved state in which the lane change model of every vehicle has advised a deceleration of 1 m/s²."""
    saved = WarmUp(read_town(_TOWN).sumocfg, 1, 30.0, tmp_path_factory.mktemp("state")).state()
    text = re.sub(r'lcStateBase="([^" ]*)[^"]*"', r'lcStateBase="\1 -1.00 262144.00"', saved.path.read_text())
    saved.path.write_text(text)
    return saved


def simulate(state: SavedState, unused_byte: int) -> str:
    """Positions and speeds of three steps in a new process, whose allocated memory is filled with a byte (glibc)."""
    environment = {**os.environ, "MALLOC_PERTURB_": str(unused_byte ^ 0xFF)}
    command = [sys.executable, "-c", _SIMULATE, _TOWN, str(state.path), str(state.time_s)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout


def test_traffic_does_not_depend_on_unused_memory(state: SavedState) -> None:
    assert simulate(state, 0x00) == simulate(state, 0xA5)


def test_only_speed_advice_is_dropped(tmp_path: Path) -> None:
    path = tmp_path / "warm.xml"
    vehicle = '<vehicle id="a" speed="6.22 5.82" lcStateBase="{}" lcState2="0 0 0 62199440 0"/>\n'
    path.write_text(vehicle.format("2316.00 -1.94 262144.00 inf 8388608.00") + vehicle.format("9.00"))
    changed = drop_speed_advice(path)
    assert changed.read_text() == vehicle.format("2316.00") + vehicle.format("9.00")
    assert drop_speed_advice(changed) == changed
