"""Plain SUMO, as a user would start it, in a process of its own."""

import os
import subprocess
import sys
import xml.etree.ElementTree as ET

import pytest

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


@pytest.fixture(scope="module")
def plain_run(town, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    outputs = ["--statistic-output", "statistics.xml", "--summary-output", "summary.xml"]
    outputs += ["--person-summary-output", "people.xml", "--summary-output.period", "10"]
    command = [sumo_home() / "bin" / "sumo", "-c", town.sumocfg, "--end", "120", "--output-prefix", f"{folder}/"]
    done = subprocess.run(
        [*map(str, command), *outputs],
        capture_output=True,
        text=True,
        env={**os.environ, "SUMO_HOME": str(sumo_home())},
    )
    return done, folder


def test_it_runs_without_errors_teleports_or_collisions(plain_run):
    done, folder = plain_run
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stderr
    warnings = [line for line in done.stderr.splitlines() if "Warning" in line and "emergency braking" not in line]
    assert warnings == []
    statistics = ET.parse(folder / "statistics.xml").getroot()
    assert statistics.find("teleports").get("total") == "0"
    assert statistics.find("safety").get("collisions") == "0"


def test_the_town_is_full_within_a_minute_and_stays_so(plain_run):
    steps = ET.parse(plain_run[1] / "summary.xml").getroot().findall("step")
    for step in steps:
        if float(step.get("time")) >= 60:
            stopped = int(step.get("stopped"))
            assert stopped >= 60
            assert int(step.get("running")) - stopped >= 70
            assert int(step.get("halting")) < 40
    people = ET.parse(plain_run[1] / "people.xml").getroot().findall("step")
    assert int(people[-1].get("walking")) >= 30


def test_parked_vehicles_stand_in_their_lots_from_the_start():
    done = subprocess.run([sys.executable, "-c", _PARKED], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    number, along_m, across_m, height_m, turned = map(float, done.stdout.split()[-5:])
    assert number >= 60
    assert along_m < 0.5
    assert across_m < 0.05
    assert height_m < 0.03
    assert turned < 0.01
