"""SUMO's library together with other libraries, and what stops it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from cosim.traffic.simulation import Traffic
from cosim.traffic.starting import TrafficError
from cosim.traffic.warm_up import WarmUp
from tests.cosim.traffic.behaviour.scenario import write_scenario

_NODES = [f'<node id="{name}" x="{x}" y="{y}"/>' for name, x, y in (("a", 0, 0), ("b", 100, 0), ("c", 0, 200))]
_EDGES = [f'<edge id="{name}" from="{name[0]}" to="{name[1]}" numLanes="1" speed="10"/>' for name in ("ab", "ca")]
_FLOW = '<flow id="f" from="ab" to="ca" begin="0" end="60" period="5"/>'


def test_another_version_of_pyarrow_makes_no_noise() -> None:
    code = (
        "import importlib.metadata as metadata; real = metadata.version; "
        "metadata.version = lambda name: '99.0.1' if name == 'pyarrow' else real(name); "
        "from cosim.traffic.starting import load_libsumo; load_libsumo().getVersion(); print('loaded')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "loaded" and not done.stderr


def test_a_vehicle_without_a_route_is_an_error_with_the_remedy(tmp_path: Path) -> None:
    config = write_scenario(tmp_path, _NODES, _EDGES, [_FLOW])
    remedy = r"Vehicle 'f\.0' has no valid route; .*<ignore-route-errors value=\"true\"/>"
    with pytest.raises(TrafficError, match=remedy):
        WarmUp(config, 1, 10.0, tmp_path).state()
    simulation = Traffic(config, 1, 0.1)
    with pytest.raises(TrafficError, match=remedy), simulation:
        simulation.step()
