"""Transport on demand: SUMO's own dispatcher sends the vehicles that a program outside would send."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.capture.config import ConfigError, load_config
from cosim.traffic.ego import ArrivedError, draw_ego
from cosim.traffic.simulation import Traffic
from cosim.traffic.starting import TrafficError
from sumo_nets.dispatch import with_dispatcher
from sumo_nets.errors import TownError
from sumo_nets.scenario import Scenario, read_scenario
from sumo_nets.tools import run_tool

_STANDS = '<trip id="v" type="shuttle" depart="0" line="D"><stop busStop="a" duration="5"/>{more}</trip>'
_PERSON = (
    '<person id="p" depart="0"><stop busStop="b" duration="2"/><ride busStop="a" lines="{lines}"/></person>'
    '<person id="q" depart="3"><stop busStop="a" duration="2"/><ride busStop="b" lines="{lines}"/></person>'
)
_WAITS = '<stop busStop="a" duration="200000"/>'


def scenario(folder: Path, vehicle: str, lines: str = "ANY") -> Scenario:
    run_tool("netgenerate", "--grid", "--grid.number", "2", "--grid.length", "150", "-o", folder / "n.net.xml")
    (folder / "r.rou.xml").write_text(
        f'<routes><vType id="shuttle" vClass="bus" length="6" personCapacity="5"/>{vehicle}'
        f"{_PERSON.format(lines=lines)}</routes>"
    )
    (folder / "s.add.xml").write_text(
        '<additional><busStop id="a" lane="A0A1_0" startPos="60" endPos="90"/>'
        '<busStop id="b" lane="B1B0_0" startPos="60" endPos="90"/></additional>'
    )
    files = {"net-file": "n.net.xml", "route-files": "r.rou.xml", "additional-files": "s.add.xml"}
    options = "".join(f'<{name} value="{value}"/>' for name, value in files.items())
    (folder / "s.sumocfg").write_text(f"<configuration>{options}</configuration>")
    return read_scenario(folder / "s.sumocfg")


def carried(result: Scenario, folder: Path, seconds: int = 600) -> set[str]:
    """Persons who ride within some time."""
    with Traffic(result.write(folder), 1, 0.5, as_given=True) as traffic:
        riders: set[str] = set()
        for _ in range(2 * seconds):
            traffic.step()
            for vehicle in traffic.api.vehicle.getIDList():
                riders |= set(traffic.api.vehicle.getPersonIDList(vehicle))
    return riders


@pytest.mark.parametrize("lines", ["ANY", "", "unknown"])
def test_vehicles_that_stand_until_they_are_sent_are_dispatched(lines, tmp_path):
    found = scenario(tmp_path, _STANDS.format(more=_WAITS), lines)
    assert carried(with_dispatcher(found, "greedy"), tmp_path / "run") == {"p", "q"}


def test_a_taxi_stays_as_it_is(tmp_path):
    taxi = _STANDS.replace(' line="D"', "").format(more='<param key="has.taxi.device" value="true"/>')
    found = with_dispatcher(scenario(tmp_path, taxi, "taxi"), "greedy")
    assert found.options["device.taxi.dispatch-algorithm"] == "greedy"
    assert found.changed == {}


def test_without_a_dispatcher_the_reason_and_the_option_are_named(tmp_path):
    found = scenario(tmp_path, _STANDS.format(more=_WAITS))
    with Traffic(found.write(tmp_path / "run"), 1, 0.5, as_given=True) as traffic:
        for _ in range(120):
            actors = traffic.step()
        with pytest.raises(TrafficError, match=r"for rides: 2, vehicles waiting for commands: 1\).*: greedy"):
            draw_ego(traffic, actors, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("vehicles", "kind", "reason"),
    [
        ('<person id="w" depart="0"><walk from="A0A1" to="A1B1"/></person>', TrafficError, "no vehicle that departs"),
        ('<trip id="v" from="A0A1" to="A1B1" depart="0"/>', ArrivedError, "all vehicles have arrived"),
    ],
)
def test_vehicles_that_have_arrived_are_distinguished_from_none(vehicles, kind, reason, tmp_path):
    path = scenario(tmp_path, "").config
    (tmp_path / "r.rou.xml").write_text(f"<routes>{vehicles}</routes>")
    with Traffic(read_scenario(path).write(tmp_path / "run"), 1, 0.5, as_given=True) as traffic:
        for _ in range(600):
            actors = traffic.step()
        with pytest.raises(TrafficError, match=reason) as refusal:
            draw_ego(traffic, actors, np.random.default_rng(0))
        assert type(refusal.value) is kind


def test_a_scenario_without_vehicles_on_demand_is_refused(tmp_path):
    with pytest.raises(TownError, match="nothing to dispatch"):
        with_dispatcher(scenario(tmp_path, '<trip id="v" from="A0A1" to="A1B1" depart="0"/>'), "greedy")


@pytest.mark.parametrize(("values", "says"), [({"town": "town01"}, "scenario of your own"), ({}, "scenario of your")])
def test_built_in_towns_have_no_dispatcher(values, says):
    with pytest.raises(ConfigError, match=says):
        load_config(None, taxi_dispatch="greedy", **values)
