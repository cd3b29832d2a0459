"""Brake lights, indicators and signals shine in images as SUMO says, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from assets import CATALOGUE, Mesh, build_model
from assets.materials import MATERIAL_NAMES
from assets.world.furniture.props import SignalHead
from assets.world.furniture.signs import signal_head
from cosim.scene.lamps import base_of, glowing_mesh, signal_models, with_lamps, with_signals, without_signals
from cosim.traffic.signals import SignalStates
from cosim.traffic.simulation import Traffic
from sensors.cameras import CLASSES, CameraRenderer, Light, semantic_image
from sensors.scene import Instances
from sumo_nets import read_town

SALOON = next(name for name, spec in CATALOGUE.items() if spec.kind == "car")
RIGHT, LEFT, EMERGENCY, BRAKE = 1, 2, 4, 8


def instances(*names: str, x_m: float = 12.0, kind: str = "car") -> Instances:
    poses = np.tile(np.eye(4), (len(names), 1, 1))
    poses[:, 0, 3] = x_m
    count = len(names)
    return Instances(
        tuple(f"veh{i}" for i in range(count)), (kind,) * count, names, poses, np.ones((count, 3)), np.ones((count, 3)),
        np.zeros((count, 3)), np.zeros(count), np.full(count, 0.4, np.float32), np.full((count, 3), 0.1, np.float32),
    )  # fmt: skip


def blinking_time(one: Instances, bits: int) -> float:
    return next(t for t in np.arange(0, 2, 0.05) if len(base_of(with_lamps(one, np.array([bits]), t).models[0])[1]))


def test_lamps_are_named_by_sumos_bits():
    one = instances(SALOON)
    assert with_lamps(one, np.array([0]), 0.0) is one
    assert base_of(with_lamps(one, np.array([BRAKE]), 0.0).models[0]) == (SALOON, "b")
    time_s = blinking_time(one, LEFT)
    assert base_of(with_lamps(one, np.array([LEFT | BRAKE]), time_s).models[0])[1] == "bl"
    assert base_of(with_lamps(one, np.array([EMERGENCY]), time_s).models[0])[1] == "lr"


def test_indicators_blink_90_times_a_minute():
    one = instances(SALOON)
    on = [bool(base_of(with_lamps(one, np.array([RIGHT]), t).models[0])[1]) for t in np.arange(0, 60, 0.01)]
    assert np.mean(on) == pytest.approx(0.5, abs=0.01)
    assert np.sum(np.diff(np.array(on, int)) == 1) == pytest.approx(90, abs=1)


def test_people_on_foot_have_no_lamps():
    walker = instances("pedestrian_01", kind="pedestrian")
    assert with_lamps(walker, np.array([BRAKE]), 0.0).models == ("pedestrian_01",)


@pytest.mark.parametrize("model", sorted({spec.body: name for name, spec in CATALOGUE.items()}.values()))
def test_every_body_lights_its_lamps_where_they_belong(model):
    mesh = build_model(model)
    braking, left = glowing_mesh(mesh, "b"), glowing_mesh(mesh, "l")
    assert np.array_equal(braking.vertices, mesh.vertices)
    tail = mesh.materials == MATERIAL_NAMES.index("tail_lamp")
    assert np.array_equal(braking.materials == MATERIAL_NAMES.index("lamp_brake"), tail)
    amber = left.triangles[left.materials == MATERIAL_NAMES.index("lamp_amber")].reshape(-1, 3)
    if tail.any() and np.ptp(mesh.triangles[tail].reshape(-1, 3)[:, 1]) > 0.5:
        assert (amber[:, 1] > 0).all() and amber[:, 0].min() < 0  # on the left, at the rear
        assert (np.abs(left.bounds - mesh.bounds) < 0.05).all()


def seen(things: Instances, world: Mesh):
    """Images from 1 m above the origin, ahead along x."""
    models = {**signal_models()}
    pose = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.0], [0, 0, 0, 1]], float)
    P = np.array([[500.0, 0, 160, 0], [0, 500, 120, 0], [0, 0, 1, 0]])

    def load(name: str) -> Mesh:
        base, lamps = base_of(name)
        return (
            models[name] if name in models else glowing_mesh(build_model(base), lamps) if lamps else build_model(base)
        )

    with CameraRenderer(world, load, Light(), width=320, height=240) as renderer:
        return renderer.render(pose, P, things)


def reds(images) -> int:
    r, g, b = (images.rgb[..., channel].astype(int) for channel in range(3))
    return int(((r > 220) & (g < 110) & (b < 110)).sum())


def test_brake_lights_shine_in_the_image():
    ground = Mesh.of(
        np.array([[-5, -50, 0], [90, -50, 0], [90, 50, 0], [-5, 50, 0]]), np.array([[0, 1, 2], [0, 2, 3]]), "asphalt"
    )
    car = instances(SALOON)
    assert reds(seen(with_lamps(car, np.array([BRAKE]), 0.0), ground)) > reds(seen(car, ground)) + 50


def head(lane: str = "a_0") -> SignalHead:
    pose = np.eye(4)
    pose[:3, 3] = 15, 0, 1.5
    return SignalHead(lane, pose)


@pytest.mark.parametrize(
    ("state", "channel", "height"),
    [("r", 0, 1), ("G", 1, -1), ("g", 1, -1)],
)
def test_one_of_three_lamps_is_on(state, channel, height):
    world, nobody = signal_head().moved((15, 0, 1.5)), instances()
    lit = seen(with_signals(nobody, [head()], {"a_0": state}, np.zeros(3), 0.0), world)
    dark = seen(with_signals(nobody, [head()], {}, np.zeros(3), 0.0), world)
    changed = np.abs(lit.rgb.astype(int) - dark.rgb).max(2) > 60
    rows, columns = np.nonzero(changed)
    assert 10 < len(rows) < 400 and lit.rgb[changed][:, channel].mean() > 200
    assert np.sign(103 - rows.mean()) == height  # the head's middle is at row 120 − 500 · 0.5 / 15
    assert abs(columns.mean() - 160) < 3
    cleaned = without_signals(lit, 0)
    assert lit.instance.any() and not cleaned.instance.any()
    assert (semantic_image(cleaned, ())[changed] == CLASSES["traffic_light"]).mean() > 0.9


def test_red_and_amber_and_flashing_amber():
    def colours(state: str, time_s: float) -> set[str]:
        return set(with_signals(instances(), [head()], {"a_0": state}, np.zeros(3), time_s).models)

    assert colours("u", 0) == {"signal_red", "signal_amber"} and colours("O", 0) == set()
    assert {len(colours("o", time_s)) for time_s in (0.0, 0.4)} == {0, 1}
    assert colours("r", 0) == {"signal_red"}


def test_heads_of_a_town_belong_to_lanes_that_sumo_signals(tmp_path: Path):
    from assets.world.build import build_world

    town = read_town("town03")
    heads = build_world(town.streets, seed=1).signals
    with Traffic(town.sumocfg, 1) as traffic:
        states = SignalStates(traffic.api).now()
        assert heads and {one.lane for one in heads} <= set(states)
        assert set(states.values()) <= set("rygGuosYO")
        before = states
        traffic.advance(300)
        assert SignalStates(traffic.api).now() != before
