"""Replay of trajectories: positions, speeds and streets of road users."""

from __future__ import annotations

import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import sumo

from cosim.capture.config import RunConfig
from cosim.capture.plan import plan_episodes
from cosim.capture.replayed import replay_episode, replay_of, signal_notes
from cosim.drives.kitti import Drive
from cosim.traffic.signals import SignalClock
from cosim.traffic.trajectories import Replay, TrajectoryError, read_trajectories
from sumo_nets import read_town
from tests.cosim.conftest import cosim, refused
from tests.sharing import made_once, record

CENTRED = "time_s,id,x,y,type\n"
STATE = """<{0}><position><point><x>{1}</x><y>{2}</y></point></position><orientation><exact>{3}</exact></orientation>
<time><exact>{4}</exact></time><velocity><exact>{5}</exact></velocity></{0}>"""


@pytest.fixture(scope="session")
def recorded(hamlet_config, tmp_path_factory) -> Path:
    """SUMO's own record of half a minute in the hamlet."""

    def make(folder: Path) -> None:
        town = read_town(hamlet_config.parent / "town")
        command = [Path(sumo.SUMO_HOME) / "bin/sumo", "-c", town.sumocfg, "--fcd-output", folder / "fcd.xml"]
        options = ["--end", "30", "--step-length", "0.2", "--no-step-log", "--no-warnings", "--fcd-output.signals"]
        subprocess.run([*map(str, command), *options], check=True, capture_output=True)

    return made_once(tmp_path_factory, "fcd", make) / "fcd.xml"


@pytest.fixture(scope="session")
def drive(recorded, hamlet_config, tmp_path_factory) -> Path:
    def make(folder: Path) -> None:
        record(hamlet_config, folder / "drive", trajectories=recorded, frames=3, seed=2, images=())

    return made_once(tmp_path_factory, "replayed", make) / "drive"


def lives(recorded: Path) -> dict[str, list[tuple[float, float, float]]]:
    found: dict[str, list[tuple[float, float, float]]] = {}
    for step in ET.parse(recorded).getroot():
        for one in step:
            row = (float(step.get("time", 0)), float(one.get("x", 0)), float(one.get("y", 0)))
            found.setdefault(one.get("id", ""), []).append(row)
    return found


def test_everybody_is_where_sumo_had_him(recorded, hamlet):
    replay, found = replay_of(recorded, hamlet), lives(recorded)
    for time_s in (5.0, 12.2, 20.0):
        actors = replay.at(time_s)
        assert len(actors) > 10
        for name, front in zip(actors.ids, actors.front, strict=True):
            x, y = next((x, y) for time, x, y in found[name] if abs(time - time_s) < 1e-6)
            assert np.hypot(front[0] - x, front[1] - y) < 1e-6
    between = replay.at(12.3)
    row = int(np.argmax(between.speed_mps))
    before, after = (replay.at(time).front[replay.at(time).ids.index(between.ids[row])] for time in (12.2, 12.4))
    assert np.allclose(between.front[row], (before + after) / 2)


def test_sizes_and_types_are_those_of_the_vtypes(recorded, hamlet):
    tracks = replay_of(recorded, hamlet).tracks
    assert {"car", "pedestrian"} <= set(tracks.kinds)
    cars = tracks.size[[kind == "car" for kind in tracks.kinds]]
    assert (cars[:, 0] > 3).all() and len(np.unique(cars[:, 0])) > 3


def test_a_drive_shows_the_replayed_traffic(drive, recorded):
    found = lives(recorded)
    frames = list(Drive(drive))
    assert len(frames) == 3
    for frame in frames:
        assert frame.twin.instances and len(frame.points) > 1000
        for thing in frame.twin.instances:
            ahead = 0.0 if thing.kind == "pedestrian" else thing.length_m / 2
            front = thing.pose[:3, 3] + ahead * thing.pose[:3, 0]
            times, x, y = np.array(found[thing.id]).T
            expected = np.interp(frame.twin.time_s, times, x), np.interp(frame.twin.time_s, times, y)
            assert np.linalg.norm(front[:2] - expected) < 0.1


def test_the_same_seed_gives_the_same_ride(recorded, hamlet):
    replay = replay_of(recorded, hamlet)
    egos = [replay.draw_ego(None, 10.0, np.random.default_rng(seed)) for seed in (1, 1, 2, 3, 4)]
    assert egos[0] == egos[1] and len(set(egos)) > 1


def table(folder: Path, header: str, rows: list[str]) -> Path:
    path = folder / "tracks.csv"
    path.write_text(header + "".join(f"{row}\n" for row in rows))
    return path


def along(hamlet) -> tuple[np.ndarray, np.ndarray]:
    """The longest lane: its start and its direction."""
    lanes = [lane for lane in hamlet.streets.lanes if lane.use == "drive" and not lane.internal]
    lane = max(lanes, key=lambda one: np.linalg.norm(one.centre[-1] - one.centre[0]))
    way = (lane.centre[-1] - lane.centre[0])[:2]
    return lane.centre[0, :2], way / np.linalg.norm(way)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("TIMESTAMP,TRACK_ID,OBJECT_TYPE,X,Y,CITY_NAME\n", "{t},a,AGENT,{x},{y},PIT"),
        ("scenario_id,track_id,object_type,timestep,position_x,position_y\n", "s,a,vehicle,{k},{x},{y}"),
        (
            "track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,length,width\n",
            "1,{k},{ms},car,{x},{y},{vx},{vy},4.2,1.8",
        ),
        (
            "object_id,timestamp,center_x,center_y,length,width,height,valid,object_type\n",
            "7,{t},{x},{y},4.2,1.8,1.6,1,1",
        ),
    ],
)
def test_tables_of_data_sets_are_read_by_their_columns(header, row, hamlet, tmp_path):
    """A car drives at 8 m/s along a lane; files say where its middle is, most of them nothing of its heading."""
    start, way = along(hamlet)
    rows = []
    for k in range(30):
        x, y = start + way * (5 + 0.8 * k)
        values = {"t": 0.1 * k, "k": k, "ms": 100 * k, "x": x, "y": y, "vx": 8 * way[0], "vy": 8 * way[1]}
        rows.append(row.format(**values))
    tracks = read_trajectories(table(tmp_path, header, rows), hamlet.streets)
    assert tracks.kinds == ("car",) and np.allclose(tracks.speed_mps, 8, atol=0.01)
    assert np.allclose(np.column_stack([np.cos(tracks.heading_rad), np.sin(tracks.heading_rad)]), way, atol=1e-3)
    actors = Replay(tracks).at(1.0)
    middle = actors.front[0, :2] - way * actors.size[0, 0] / 2
    assert np.allclose(middle, start + way * 13, atol=1e-3) and np.isfinite(actors.front[0, 2])
    assert abs(actors.acceleration_mps2[0]) < 0.1


def test_the_table_of_the_traffic_loop_is_read(hamlet_config, hamlet, tmp_path):
    (tmp_path / "c.yaml").write_text(f"town: {hamlet_config.parent / 'town'}\nseed: 1\nwarm_up_s: 5\n")
    cosim("traffic-record", "--config", tmp_path / "c.yaml", "--out", tmp_path / "t.csv", "--seconds", 10)
    replay = replay_of(tmp_path / "t.csv", hamlet)
    actors = replay.at(float(replay.tracks.time_s.min()) + 5)
    moving = actors.speed_mps > 2
    assert moving.any() and len(actors) > 5
    later = replay.at(actors.time_s + 0.1)
    for row in np.flatnonzero(moving):
        if actors.ids[row] in later.ids:
            step = later.front[later.ids.index(actors.ids[row]), :2] - actors.front[row, :2]
            assert step @ [np.cos(actors.heading_rad[row]), np.sin(actors.heading_rad[row])] > 0


def commonroad(folder: Path) -> Path:
    """Two lanelets side by side, one moving and one stopped car."""
    lanes = ""
    for number, y in ((1, 0.0), (2, 3.5)):
        points = {side: [(x, y + half) for x in range(0, 121, 10)] for side, half in (("left", 1.75), ("right", -1.75))}
        bounds = "".join(
            f"<{side}Bound>{''.join(f'<point><x>{x}</x><y>{v}</y></point>' for x, v in points[side])}</{side}Bound>"
            for side in points
        )
        lanes += f'<lanelet id="{number}">{bounds}<laneletType>urban</laneletType></lanelet>'
    shape = "<type>car</type><shape><rectangle><length>4.4</length><width>1.8</width></rectangle></shape>"
    states = "".join(STATE.format("state", 10 + k, 0, 0, k, 10) for k in range(1, 60))
    first, still = STATE.format("initialState", 10, 0, 0, 0, 10), STATE.format("initialState", 60, 3.5, 0, 0, 0)
    path = folder / "two_lanes.xml"
    path.write_text(
        f'<commonRoad timeStepSize="0.1">{lanes}<dynamicObstacle id="42">{shape}{first}'
        f"<trajectory>{states}</trajectory></dynamicObstacle>"
        f'<staticObstacle id="43">{shape}{still}</staticObstacle>'
        f'<staticObstacle id="44">{shape.replace("car", "building")}{still}</staticObstacle></commonRoad>'
    )
    return path


def test_a_commonroad_scenario_is_streets_and_traffic(tmp_path, hamlet_config, caplog):
    path = commonroad(tmp_path)
    sensor = hamlet_config.parent / "sensor.yaml"
    record(None, tmp_path / "d", trajectories=path, sensor=str(sensor), frames=3, images=())
    assert caplog.messages.count(f"{path}: left out, as they are no road users: 1 of 'building'") == 1
    drive = Drive(tmp_path / "d")
    for frame in drive:
        assert [thing.id for thing in frame.twin.instances] == ["43"]
        thing = frame.twin.instances[0]
        assert np.allclose(thing.pose[:2, 3], [60, 3.5], atol=0.02) and thing.length_m == pytest.approx(4.4)
        assert frame.twin.ego.velocity_mps == pytest.approx([10, 0, 0], abs=0.1)
        assert frame.twin.ego.pose[0, 3] == pytest.approx(10 + 10 * frame.twin.time_s, abs=0.05)


def fcd(folder: Path, rows: str) -> Path:
    path = folder / "fcd.xml"
    path.write_text(f"<fcd-export>{rows}</fcd-export>")
    return path


def step(time_s: float, **values: object) -> str:
    given = {"id": "a", "x": 0, "y": 0, "angle": 90, "speed": 5, "type": "car", **values}
    return f'<timestep time="{time_s}"><vehicle {" ".join(f"""{k}="{v}" """ for k, v in given.items())}/></timestep>'


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("", "holds no sample"),
        (step(0) + step(0.1, x=40), "'a' jumps by 40.0 m from 0 to 0.1 s"),
        (step(0) + step(0), "two samples at 0 s"),
        (step(0, x="east"), "has x 'east'"),
        (step(0, x="nan"), "times and places are finite"),
        (step(0, x=9e5) + step(1, x=9e5), "most places lie off the streets"),
        (step(0, type="rail"), "holds no sample of a road user"),
    ],
)
def test_trajectories_that_cannot_be_are_refused(rows, says, hamlet, tmp_path):
    with pytest.raises(TrajectoryError, match=says) as caught:
        replay_of(fcd(tmp_path, rows), hamlet)
    assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def signalled(tmp_path_factory) -> Path:
    """A crossing with signals of its own cycle, and what SUMO writes of them and of a car; returns the `.sumocfg`."""
    folder, programs = tmp_path_factory.mktemp("signalled"), Path(sumo.SUMO_HOME) / "bin"
    grid = ["--grid", "--grid.number", "2", "--grid.attach-length", "90", "--default-junction-type", "traffic_light"]
    subprocess.run([programs / "netgenerate", *grid, "-o", folder / "n.net.xml"], check=True, capture_output=True)
    program = next(one for one in ET.parse(folder / "n.net.xml").iter("tlLogic") if one.get("id") == "A0")
    program.attrib |= {"programID": "own", "offset": "7.5"}
    for phase in program:
        phase.set("duration", str(round(float(phase.get("duration", 0)) / 3, 1)))
    (folder / "own.add.xml").write_text(f"<additional>{ET.tostring(program).decode()}</additional>")
    event = '<additional><timedEvent type="SaveTLSStates" source="A0" dest="states.xml"/></additional>'
    (folder / "out.add.xml").write_text(event)
    car = '<routes><flow id="car" begin="0" end="30" period="10" from="left0A0" to="A0B0"/></routes>'
    (folder / "r.rou.xml").write_text(car)
    files = {"net-file": "n.net.xml", "route-files": "r.rou.xml", "additional-files": "own.add.xml"}
    options = "".join(f'<{name} value="{value}"/>' for name, value in files.items())
    (folder / "t.sumocfg").write_text(f"<configuration>{options}</configuration>")
    command = [programs / "sumo", "-c", "t.sumocfg", "-a", "own.add.xml,out.add.xml", "--fcd-output", "fcd.xml"]
    options = ["--end", "60", "--step-length", "0.1", "--no-step-log"]
    subprocess.run([*command, *options], check=True, capture_output=True, cwd=folder)
    return folder / "t.sumocfg"


def test_signals_show_what_sumo_had_them_show(signalled):
    town, incoming = read_town(signalled), {}
    for one in ET.parse(town.net).iter("connection"):
        if one.get("tl") == "A0":
            incoming.setdefault(f"{one.get('from')}_{one.get('fromLane')}", int(one.get("linkIndex", 0)))
    states = {float(one.get("time", 0)): one.get("state", "") for one in ET.parse(town.folder / "states.xml").iter()}
    seen = set()
    with SignalClock(town, 3.0) as clock:
        assert clock.unknown == ()
        for time_s in (4.0, 7.4, 7.5, 21.3, 48.0, 12.9):  # the last one is a step back
            shown = clock.at(time_s)
            assert all(shown[lane] == states[time_s][index] for lane, index in incoming.items())
            seen.add("".join(shown[lane] for lane in incoming))
    assert len(seen) > 2


def test_a_replay_of_fcd_output_has_signals_and_one_of_a_table_has_none(signalled, tmp_path):
    town, shown = read_town(signalled), []
    recorder = SimpleNamespace(note=lambda entry: None, record=lambda *frame: shown.append(frame[4]))
    config = RunConfig(town=str(signalled), frames=2, collection={"every_s": 2.0, "min_travel_m": 0.5})
    fcd_output = town.folder / "fcd.xml"
    rows = [f"{0.1 * k},a,{4.0 + k},-1.6,car" for k in range(120)]
    for path in (fcd_output, table(tmp_path, CENTRED, rows)):
        replay = replay_of(path, town)
        assert signal_notes(replay, town) == ()
        plan = plan_episodes(config)[0]
        replay_episode(plan, config, town, replay, recorder, done=(), on_frame=lambda name: None)
    assert [len(states) > 4 for states in shown] == [True, True, False, False]


def test_signals_that_look_at_traffic_stay_dark_which_is_said(signalled, tmp_path):
    net = (signalled.parent / "n.net.xml").read_text().replace('id="B1" type="static"', 'id="B1" type="actuated"')
    (tmp_path / "n.net.xml").write_text(net)
    town = read_town(tmp_path / "n.net.xml")
    replay = replay_of(signalled.parent / "fcd.xml", town)
    (note,) = signal_notes(replay, town)
    assert "1 signals stay dark" in note and "B1" in note
    with SignalClock(town, 0.0) as clock:
        assert not any(lane.startswith("A1B1") for lane in clock.at(2.0)) and "left0A0_0" in clock.at(2.0)


def test_bad_input_ends_in_one_line(recorded, hamlet_config, tmp_path):
    town = hamlet_config.parent / "town"
    run = ("run", "--out", tmp_path / "d", "--town", town)
    assert "no such file" in refused(*run, "--trajectories", tmp_path / "none.csv")
    (tmp_path / "a.csv").write_text("t,who\n1,2\n")
    assert "columns are missing" in refused(*run, "--trajectories", tmp_path / "a.csv")
    assert "no traffic" in refused("run", "--out", tmp_path / "d", "--town", next(town.glob("*.net.xml")))
    (tmp_path / "c.yaml").write_text(f"town: {town}\ntrajectories: {recorded}\nego: unknown_car\n")
    assert "ego 'unknown_car' is not in the trajectories" in refused(
        "run", tmp_path / "c.yaml", "--out", tmp_path / "d"
    )
    still = "".join(step(0.2 * k, x=-20, y=0, speed=0) for k in range(9))
    assert "no vehicle of the trajectories moves" in refused(*run, "--trajectories", fcd(tmp_path, still))
    with pytest.raises(ValueError, match="give `trajectories`"):
        RunConfig(ego="a")
