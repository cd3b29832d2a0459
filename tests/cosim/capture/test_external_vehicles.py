"""External vehicles are simulated together with those of the catalogue, with exactly their vTypes' sizes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from assets import CATALOGUE
from assets.external import load_external
from cosim.cli import main
from cosim.scene.bridge import Bridge
from cosim.scene.ground import Ground
from tests.assets.test_external import car_parts, manifest, write_gltf
from tests.cosim.road_users import road_users
from tests.cosim.scene.test_bridge import slope

CARS = 80


@pytest.fixture
def vehicles(tmp_path: Path) -> Path:
    write_gltf(tmp_path / "blocky.glb", car_parts())
    return manifest(tmp_path, {"file": "blocky.glb", "kind": "car"})


def test_the_bridge_draws_among_both_and_scales_to_the_vtype(vehicles: Path) -> None:
    external = load_external(vehicles)
    size = np.array(CATALOGUE["hatchback_05"].size_m)
    many = road_users(["car"] * CARS, np.zeros((CARS, 3)), sizes=np.tile(size, (CARS, 1)))
    placed = Bridge(Ground(slope(0, 0)), 1, external).place(many)
    assert "blocky" in placed.models
    assert len(set(placed.models)) > 1
    row = placed.models.index("blocky")
    box = external.meshes["blocky"].bounds * placed.scales[row]
    np.testing.assert_allclose(np.ptp(box, axis=0), size, rtol=1e-6)
    assert np.isfinite(placed.poses).all()


def test_without_external_vehicles_nothing_changes(vehicles: Path) -> None:
    size = np.array(CATALOGUE["bus_01"].size_m)
    many = road_users(["bus"] * CARS, np.zeros((CARS, 3)), sizes=np.tile(size, (CARS, 1)))
    plain = Bridge(Ground(slope(0, 0)), 1).place(many)
    assert Bridge(Ground(slope(0, 0)), 1, load_external(vehicles)).place(many).models == plain.models


@pytest.mark.parametrize("text", ["- {file: absent.glb, kind: car}", "- {file: x.glb, kind: car, tint: 3}"])
def test_a_broken_folder_ends_the_run_with_a_line(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "vehicles.yaml").write_text(text)
    config = tmp_path / "run.yaml"
    config.write_text(f"external_vehicles: {tmp_path}\n")
    assert main(["run", str(config), "--out", str(tmp_path / "drive"), "--quiet"]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert str(tmp_path) in message
