"""Networks far from zero get a local origin, and are the same there as near zero."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.driver_discrepancy.table import read_measured
from cosim.traffic.trajectories import read_trajectories
from sumo_nets import read_town
from sumo_nets.local_origin import find_origin, move_file
from sumo_nets.tools import run_tool
from sumo_nets.xml_guard import read_xml


@pytest.fixture(scope="module")
def near(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("near")
    nodes = "".join(f'<node id="{n}" x="{x}" y="{y}"/>' for n, x, y in (("a", -90, 0), ("b", 0, 0), ("c", 80.5, 40.25)))
    edges = "".join(f'<edge id="{a}{b}" from="{a}" to="{b}"/>' for a, b in ("ab", "bc", "cb", "ba"))
    (folder / "n.nod.xml").write_text(f"<nodes>{nodes}</nodes>")
    (folder / "n.edg.xml").write_text(f"<edges>{edges}</edges>")
    files = ("--node-files", folder / "n.nod.xml", "--edge-files", folder / "n.edg.xml")
    run_tool("netconvert", *files, "--offset.disable-normalization", "--output-file", folder / "n.net.xml")
    return folder / "n.net.xml"


def moved_town(near: Path, folder: Path, offset: tuple[float, float, float]):
    """The town with its coordinates moved by an offset."""
    backwards = (-offset[0], -offset[1], 0.0)
    far = folder / "n.net.xml"
    far.write_bytes(move_file(near, read_xml(near), backwards).read_bytes())
    (folder / "r.rou.xml").write_text('<routes><flow id="f" from="ab" to="bc" begin="0" end="9" period="3"/></routes>')
    (folder / "p.add.xml").write_text(
        f'<additional><poly id="house" type="building" shape="{offset[0] + 20},{offset[1] + 20} {offset[0] + 30},'
        f'{offset[1] + 20} {offset[0] + 30},{offset[1] + 30}"/></additional>'
    )
    files = {"net-file": "n.net.xml", "route-files": "r.rou.xml", "additional-files": "p.add.xml"}
    options = "".join(f'<{name} value="{value}"/>' for name, value in files.items())
    (folder / "t.sumocfg").write_text(f"<configuration>{options}</configuration>")
    return read_town(folder / "t.sumocfg")


@pytest.mark.parametrize("offset", [(691000.0, 5335000.0, 0.0), (1_492_000.0, 6_890_000.0, 0.0), (-20_000.0, 0.0, 0.0)])
def test_streets_are_the_same_at_any_offset(near, offset, tmp_path):
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
    here, there = moved_town(near, tmp_path / "here", (0.0, 0.0, 0.0)), moved_town(near, tmp_path / "there", offset)
    assert here.streets.origin_m == (0, 0, 0) and there.streets.origin_m == offset
    for a, b in zip(here.streets.lanes, there.streets.lanes, strict=True):
        assert a.id == b.id and np.array_equal(a.centre, b.centre)
    for a, b in zip(here.streets.areas, there.streets.areas, strict=True):
        assert np.array_equal(a.outline, b.outline)
    assert np.allclose(here.streets.buildings[0].outline, there.streets.buildings[0].outline)


def test_trajectories_may_have_either_coordinates(near, tmp_path):
    offset = np.array([691000.0, 5335000.0])
    town = moved_town(near, tmp_path, (691000.0, 5335000.0, 0.0))
    for shift in (offset, 0 * offset):
        path = tmp_path / "fcd.xml"
        steps = [
            f'<timestep time="{k}"><vehicle id="v" x="{shift[0] - 80 + 8 * k}" y="{shift[1] - 1.6}" angle="90" '
            f'type="car" speed="8" lane="ab_0"/></timestep>'
            for k in range(9)
        ]
        path.write_text(f"<fcd-export>{''.join(steps)}</fcd-export>")
        tracks = read_trajectories(path, town.streets)
        assert np.allclose(tracks.front[0], [-80, -1.6, 0], atol=1e-6)


def test_only_far_networks_have_an_origin():
    assert find_origin(np.array([[9_000.0, -9_000.0]])) == (0, 0, 0)
    assert find_origin(np.array([[10_600.0, 0.0], [10_700.0, 3.0], [10_900.0, 1.0]])) == (11_000, 0, 0)


@pytest.mark.parametrize("shift", [0.0, 1.0])
def test_tables_of_the_traffic_loop_may_have_either_coordinates(near, shift, tmp_path):
    offset = np.array([691000.0, 5335000.0])
    town = moved_town(near, tmp_path, (691000.0, 5335000.0, 0.0))
    rows = [
        f"{k},{name},{x0 + 8 * k + shift * offset[0]},{y + shift * offset[1]},8,90,{lane},car"
        for k in range(5)
        for name, x0, y, lane in (("a", -80, -1.6, "ab_0"), ("b", -60, -1.6, "ab_0"))
    ]
    path = tmp_path / "measured.csv"
    path.write_text("\n".join(["time_s,id,x_m,y_m,speed_mps,heading_deg,lane,type", *rows]) + "\n")
    tracks = read_measured(path, town)
    assert np.allclose(tracks.place[0], [-80, -1.6], atol=1e-6)
