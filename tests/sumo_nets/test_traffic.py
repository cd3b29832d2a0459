"""Plain SUMO, as a user would start it, in a process of its own."""

import os
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

from sumo_nets import RECIPES, TOWNS, read_town
from sumo_nets.tools import sumo_home

_PARKED = """
import sys, libsumo, numpy as np
from sumo_nets import read_town
town = read_town("town01")
lots = {bay.id: bay for bay in town.streets.parking}
libsumo.start(["sumo", "-c", str(town.sumocfg)])
while libsumo.simulation.getTime() < 2:
    libsumo.simulationStep()
vehicles = [v for v in libsumo.vehicle.getIDList() if v.startswith("parked")]
worst = np.zeros(4)
for v in vehicles:
    assert libsumo.vehicle.isStoppedParking(v), v
    lot = lots[libsumo.vehicle.getStops(v, 1)[0].stoppingPlaceID]
    ahead = (lot.centre[-1] - lot.centre[0])[:2]
    ahead = ahead / np.linalg.norm(ahead)
    off = np.array(libsumo.vehicle.getPosition3D(v)) - lot.centre[-1]
    angle = np.radians(90 - libsumo.vehicle.getAngle(v))
    turned = np.cross([*ahead, 0], [np.cos(angle), np.sin(angle), 0])[2]
    worst = np.maximum(worst, np.abs([off[:2] @ ahead, off[0] * ahead[1] - off[1] * ahead[0], off[2], turned]))
print(len(vehicles), *worst)
"""


def _run(name, end_s, folder):
    outputs = ["--statistic-output", "statistics.xml", "--summary-output", "summary.xml"]
    outputs += ["--person-summary-output", "people.xml", "--summary-output.period", "10"]
    command = [sumo_home() / "bin" / "sumo", "-c", read_town(name).sumocfg, "--end", end_s]
    return subprocess.run(
        [*map(str, command), "--output-prefix", f"{folder}/", *outputs],
        capture_output=True,
        text=True,
        env={**os.environ, "SUMO_HOME": str(sumo_home())},
    )


@pytest.fixture(scope="module", params=TOWNS)
def plain_run(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    return request.param, _run(request.param, 120, folder), folder


def _assert_peaceful(done, folder):
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stderr
    statistics = ET.parse(folder / "statistics.xml").getroot()
    assert statistics.find("teleports").get("total") == "0"
    assert statistics.find("safety").get("collisions") == "0"


def test_it_runs_without_errors_teleports_or_collisions(plain_run):
    _, done, folder = plain_run
    _assert_peaceful(done, folder)
    harmless = ("emergency braking", "Collision of person")  # people brush past each other on narrow pavements
    warnings = [line for line in done.stderr.splitlines() if "Warning" in line]
    assert [line for line in warnings if not any(words in line for words in harmless)] == []


def test_the_town_is_full_within_a_minute_and_stays_so(plain_run):
    name, _, folder = plain_run
    demand = RECIPES[name].demand
    steps = ET.parse(folder / "summary.xml").getroot().findall("step")
    for step in steps:
        if float(step.get("time")) >= 60:
            stopped = int(step.get("stopped"))
            assert stopped == demand.parked
            assert int(step.get("running")) - stopped >= 0.9 * demand.driving
            assert int(step.get("halting")) < 0.5 * demand.driving
    people = ET.parse(folder / "people.xml").getroot().findall("step")
    assert int(people[-1].get("walking")) >= 0.8 * demand.walking


@pytest.mark.slow
@pytest.mark.parametrize("name", TOWNS)
def test_traffic_flows_after_twenty_minutes(name, tmp_path):
    _assert_peaceful(_run(name, 1200, tmp_path), tmp_path)
    steps = ET.parse(tmp_path / "summary.xml").getroot().findall("step")[-30:]
    moving = [float(step.get("meanSpeed")) for step in steps]
    halting = [int(step.get("halting")) / RECIPES[name].demand.driving for step in steps]
    assert min(moving) > 2.5
    assert max(halting) < 0.6


def test_parked_vehicles_stand_in_their_lots_from_the_start():
    done = subprocess.run([sys.executable, "-c", _PARKED], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    number, along_m, across_m, height_m, turned = map(float, done.stdout.split()[-5:])
    assert number >= 60
    assert along_m < 0.5
    assert across_m < 0.05
    assert height_m < 0.03
    assert turned < 0.01
