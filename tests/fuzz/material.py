"""One whole file of every kind that a stranger may send."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import trimesh

from assets import build_model
from assets.shapes import box
from cosim.drives.kitti.labels import read_labels
from cosim.drives.twin import encode_glb
from sumo_nets.tools import run_tool

_RIG = Path(__file__).parents[2] / "sensors/rigs/roof_three.yaml"
SENSOR = """pattern: hdl64e
effects:
  - {effect: dual_block, upper_m: 0.0405, lower_m: -0.0405}
  - {effect: range_noise, sigma_m: 0.02}
"""
RUN = """town: town01
frames: 3
seed: 1
behaviour: {preset: paper, u_turns_per_min: 2.0}
population: {driving_factor: [0.5, 1.0]}
"""
VEHICLES = (
    "- {file: car.glb, class: car, name: a, forward: +x}\n"
    "- {file: box.obj, class: van, name: b, up: z, forward: x}\n- {file: box.dae, class: truck, name: c, forward: x}\n"
)


def make_material(drive: Path, folder: Path) -> None:
    """Fill a folder with what `READERS` read.

    Args:
        drive: a simulated drive.
        folder: to fill.
    """
    _copy_one_frame(drive, folder / "drive")
    shutil.copyfile(drive / "pattern.yaml", folder / "pattern.yaml")
    (folder / "sensor.yaml").write_text(SENSOR)
    (folder / "run.yaml").write_text(RUN)
    (folder / "car.glb").write_bytes(encode_glb(build_model("saloon_01"), "car"))
    _make_vehicles(folder / "vehicles")
    _make_town(folder / "town")
    rows = [
        f"{0.1 * step:.1f},{name},{x0 + step:.2f},{3.0 * lane:.1f},10.0,90.0,e_{lane},car"
        for step in range(30)
        for lane, (name, x0) in enumerate((("a", 0.0), ("b", 20.0)))
    ]
    header = "time_s,id,x_m,y_m,speed_mps,heading_deg,lane,type"
    (folder / "tracks.csv").write_text("\n".join([header, *rows]) + "\n")
    _make_motion(folder)
    (folder / "detections").mkdir()
    labels = (folder / "drive/label_2/000000.txt").read_text().splitlines()
    seen = [f"{line} 0.9" for line in labels if not line.startswith("DontCare")]
    (folder / "detections/000000.txt").write_text("\n".join(seen) + "\n")


def _make_motion(folder: Path) -> None:
    """Trajectories in other formats, a rig and a world."""
    rows = [f"{k},1,vehicle,{k},{0.8 * k:.2f},0.5,0.0,8.0,0.0" for k in range(30)]
    header = "scenario_id,track_id,object_type,timestep,position_x,position_y,heading,velocity_x,velocity_y"
    (folder / "motion.csv").write_text("\n".join([header, *rows]) + "\n")
    vehicle = '<vehicle id="a" x="{1}" y="0" angle="90" type="car" speed="8" pos="1" lane="e_0"/>'
    step = f'<timestep time="{{0}}">{vehicle}</timestep>'
    (folder / "fcd.xml").write_text(f"<fcd-export>{''.join(step.format(k, 8 * k) for k in range(9))}</fcd-export>")
    state = (
        "<{0}><position><point><x>{1}</x><y>0</y></point></position><orientation><exact>0</exact></orientation>"
        "<time><exact>{2}</exact></time><velocity><exact>8</exact></velocity></{0}>"
    )
    bounds = "".join(
        f"<{side}Bound><point><x>0</x><y>{y}</y></point><point><x>90</x><y>{y}</y></point></{side}Bound>"
        for side, y in (("left", 2), ("right", -2))
    )
    states = "".join(state.format("state", 5 + k, k) for k in range(1, 9))
    (folder / "lanes.xml").write_text(
        f'<commonRoad timeStepSize="0.1"><lanelet id="1">{bounds}</lanelet><dynamicObstacle id="2"><type>car</type>'
        "<shape><rectangle><length>4</length><width>2</width></rectangle></shape>"
        f"{state.format('initialState', 5, 0)}<trajectory>{states}</trajectory></dynamicObstacle></commonRoad>"
    )
    (folder / "play.xosc").write_text(_openscenario())
    (folder / "drive.xosc").write_text(_driving())
    (folder / "street.xodr").write_text(_opendrive())
    shutil.copyfile(_RIG, folder / "rig.yaml")
    (folder / "road.glb").write_bytes(encode_glb(box((200, 30, 0.2), (50, 0, -0.1), "asphalt"), "road"))


def _openscenario() -> str:
    """A car that waits and then follows a trajectory."""
    at = '<Position><WorldPosition x="{}" y="0.5" z="0" h="0"/></Position>'
    line = "".join(f'<Vertex time="{k}">{at.format(8 * k)}</Vertex>' for k in range(6))
    begins = (
        '<StartTrigger><ConditionGroup><Condition name="t" delay="0" conditionEdge="none"><ByValueCondition>'
        '<SimulationTimeCondition value="1" rule="greaterThan"/></ByValueCondition></Condition></ConditionGroup>'
        "</StartTrigger>"
    )
    follows = (
        '<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="way" closed="false">'
        "<Shape>"
        f"<Polyline>{line}</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference>"
        '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference>'
        '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
    )
    car = (
        '<Vehicle name="car" vehicleCategory="car"><BoundingBox><Center x="1.4" y="0" z="0.75"/>'
        '<Dimensions width="1.8" length="4.4" height="1.5"/></BoundingBox>'
        '<Performance maxSpeed="60" maxAcceleration="5" maxDeceleration="9"/><Axles>'
        '<FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>'
        '<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>'
        "<Properties/></Vehicle>"
    )
    return (
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="1" date="2024-01-01T00:00:00" description="d" author="a"/>'
        '<ParameterDeclarations><ParameterDeclaration name="x" parameterType="double" value="2"/>'
        "</ParameterDeclarations>"
        f'<CatalogLocations/><RoadNetwork/><Entities><ScenarioObject name="a">{car}</ScenarioObject></Entities>'
        '<Storyboard><Init><Actions><Private entityRef="a"><PrivateAction><TeleportAction>'
        f"{at.format('$x')}</TeleportAction></PrivateAction></Private></Actions></Init>"
        f'<Story name="s"><Act name="act"><ManeuverGroup name="g" maximumExecutionCount="1">'
        '<Actors selectTriggeringEntities="false"><EntityRef entityRef="a"/></Actors><Maneuver name="m">'
        f'<Event name="e" priority="overwrite"><Action name="b">{follows}</Action>{begins}</Event></Maneuver>'
        f"</ManeuverGroup>{begins}</Act></Story><StopTrigger/></Storyboard></OpenSCENARIO>"
    )


def _driving() -> str:
    """A car that drives along lanes of `street.xodr` and changes lane, next to another one."""
    text = _openscenario()
    start, end = text.index("<PrivateAction><RoutingAction>"), text.index("</RoutingAction></PrivateAction>")
    change = (
        '<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics value="2" dynamicsShape="cubic" '
        'dynamicsDimension="time"/><LaneChangeTarget><RelativeTargetLane entityRef="a" value="1"/></LaneChangeTarget>'
        "</LaneChangeAction></LateralAction></PrivateAction>"
    )
    text = text[:start] + change + text[end + len("</RoutingAction></PrivateAction>") :]
    speed = (
        '<PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" value="3" '
        'dynamicsDimension="rate"/><SpeedActionTarget><AbsoluteTargetSpeed value="9"/></SpeedActionTarget>'
        "</SpeedAction></LongitudinalAction></PrivateAction>"
    )
    at = '<Position><LanePosition roadId="1" laneId="-2" s="5" offset="0.2"/></Position>'
    text = text.replace(
        '<Position><WorldPosition x="$x" y="0.5" z="0" h="0"/></Position></TeleportAction></PrivateAction></Private>',
        f"{at}</TeleportAction></PrivateAction>{speed}</Private>",
    )
    return text.replace("<RoadNetwork/>", '<RoadNetwork><LogicFile filepath="street.xodr"/></RoadNetwork>')


def _opendrive() -> str:
    """Two roads that follow each other, of all kinds of geometry."""
    shapes = (
        "<line/>",
        '<spiral curvStart="0" curvEnd="0.001"/>',
        '<arc curvature="0.001"/>',
        '<poly3 a="0" b="0" c="0" d="0.0001"/>',
        '<paramPoly3 pRange="normalized" aU="0" bU="20" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/>',
    )
    lane = (
        '<lane id="{0}" type="driving"><link><successor id="{0}"/><predecessor id="{0}"/></link>'
        '<width sOffset="0" a="3" b="0.01" c="0" d="0"/></lane>'
    )
    lanes = (
        '<lanes><laneOffset s="0" a="3" b="0" c="0" d="0"/><laneSection s="{0}"><left>'
        f"{lane.format(1)}</left><right>{lane.format(-1)}{lane.format(-2)}</right></laneSection>"
        f'<laneSection s="{{1}}"><right>{lane.format(-1)}{lane.format(-2)}</right></laneSection></lanes>'
    )
    roads = ""
    for number, link in ((1, "successor"), (2, "predecessor")):
        x = 50 * (number - 1)
        pieces = "".join(
            f'<geometry s="{10 * k}" x="{x + 10 * k}" y="0" hdg="0" length="10">{shape}</geometry>'
            for k, shape in enumerate(shapes)
        )
        contact = "start" if number == 1 else "end"
        roads += (
            f'<road id="{number}" length="50" junction="-1"><link><{link} elementType="road" elementId="{3 - number}" '
            f'contactPoint="{contact}"/></link><planView>{pieces}</planView><elevationProfile>'
            '<elevation s="0" a="0" b="0.01" c="0" d="0"/></elevationProfile><lateralProfile>'
            f'<superelevation s="0" a="0.01" b="0" c="0" d="0"/></lateralProfile>{lanes.format(0, 25)}</road>'
        )
    return f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{roads}</OpenDRIVE>'


def _copy_one_frame(drive: Path, target: Path) -> None:
    """The first frame of a drive, with a few labels and points, so that changes hit what matters."""
    entry = next(json.loads(line) for line in (drive / "manifest.jsonl").read_text().splitlines() if '"name"' in line)
    for name in (*entry["files"], "drive.yaml", "twin/materials.yaml"):
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(drive / name, target / name)
    (target / "manifest.jsonl").write_text(json.dumps(entry) + "\n")
    points = target / entry["files"][0]
    points.write_bytes(points.read_bytes()[:16_000])
    assert len(read_labels(target / "label_2/000000.txt").type)


def _make_vehicles(folder: Path) -> None:
    folder.mkdir()
    box = trimesh.creation.box(extents=(4.0, 1.8, 1.5))
    (folder / "car.glb").write_bytes(encode_glb(build_model("saloon_01"), "car"))
    (folder / "box.obj").write_text(box.export(file_type="obj"))
    exported = box.export(file_type="dae")
    (folder / "box.dae").write_bytes(exported if isinstance(exported, bytes) else exported.encode())
    (folder / "vehicles.yaml").write_text(VEHICLES)


def _make_town(folder: Path) -> None:
    folder.mkdir()
    run_tool("netgenerate", "--grid", "--grid.number", "2", "--grid.length", "80", "-o", folder / "town.net.xml")
    (folder / "town.sumocfg").write_text(
        '<configuration><net-file value="town.net.xml"/><additional-files value="town.add.xml"/></configuration>\n'
    )
    (folder / "town.add.xml").write_text(
        '<additional><vType id="car" length="4.5"/><parkingArea id="p" lane="A0A1_0" startPos="10" endPos="40" '
        'roadsideCapacity="4"><space x="1" y="2" length="5" width="2"/></parkingArea>'
        '<poly id="b" type="building" shape="10,10 20,10 20,20"><param key="height" value="8"/></poly>'
        '<poi id="t" type="natural.tree" x="5" y="5"/></additional>\n'
    )
