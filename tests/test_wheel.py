"""What is installed from a wheel is all that the repository has: towns, patterns, sensors, scripts, configurations."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest
import yaml

from tests.cosim.hamlet import write_hamlet
from tests.sharing import made_once

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("assets", "sumo_nets", "sensors", "cosim", "training")
_LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.egg-info")
_BUILD = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of the repository, built from a copy: building leaves files among the sources."""
    pytest.importorskip("setuptools")

    def build(folder: Path) -> None:
        for package in PACKAGES:
            shutil.copytree(ROOT / package, folder / "source" / package, ignore=_LEFT_OUT)
        for name in ("pyproject.toml", "README.md", "LICENSE"):
            shutil.copyfile(ROOT / name, folder / "source" / name)
        command = [sys.executable, "-c", _BUILD, str(folder)]
        subprocess.run(command, cwd=folder / "source", check=True, capture_output=True, timeout=300)

    (made,) = made_once(tmp_path_factory, "wheel", build).glob("*.whl")
    return made


def test_a_wheel_holds_every_file_of_the_packages(wheel):
    ours = {
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.is_file() and path.suffix != ".pyc" and ".egg-info" not in str(path)
    }
    packed = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert packed == ours
    for kind in ("sumo_nets/towns/town01/", "sensors/patterns/", "sensors/models/", "cosim/view/scripts/"):
        assert any(name.startswith(kind) and not name.endswith(".py") for name in packed), kind


def test_a_wheel_brings_the_command_and_no_tests(wheel):
    archive = zipfile.ZipFile(wheel)
    (entry_points,) = (name for name in archive.namelist() if name.endswith("entry_points.txt"))
    assert "cosim = cosim.cli:main" in archive.read(entry_points).decode()
    assert not [name for name in archive.namelist() if name.startswith(("tests/", "docs/", "tools/"))]


@pytest.mark.slow
def test_an_empty_environment_elsewhere_records_diagnoses_and_shows_pages(wheel, tmp_path):
    environment, work = tmp_path / "environment", tmp_path / "work"
    work.mkdir()
    venv.create(environment, with_pip=True)
    pip = [str(environment / "bin/pip"), "install", "--quiet", "-c", str(ROOT / "constraints.txt"), str(wheel)]
    if subprocess.run(pip, capture_output=True, timeout=1800).returncode:
        pytest.skip("no package index in reach: nothing can be installed")

    def cosim(*arguments: object) -> str:
        command = [str(environment / "bin/cosim"), *map(str, arguments)]
        clean = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "OMP_NUM_THREADS": "1"}
        done = subprocess.run(command, cwd=work, env=clean, capture_output=True, text=True, timeout=3000)
        assert done.returncode == 0, done.stderr[-3000:]
        return done.stdout

    assert "works    SUMO" in cosim("doctor")
    assert "range_walk" in cosim("effects")
    cosim("run", write_hamlet(tmp_path / "hamlet"), "--out", "drive", "--quiet")
    cosim("run", "--town", "town01", "--frames", 1, "--out", "town", "--quiet")
    cosim("view", "drive", "--out", "pages", "--quiet")
    assert (work / "pages/index.html").stat().st_size > 100_000
    believed = yaml.safe_load((tmp_path / "hamlet/sensor.yaml").read_text())
    believed["pattern"] = str(tmp_path / "hamlet/small.yaml")
    noise = {"effect": "range_noise", "sigma_m": 0.02}
    for name, further in (("believed", []), ("true", [{"effect": "range_bias", "offset_m": 0.1}])):
        (work / f"{name}.yaml").write_text(yaml.safe_dump({**believed, "effects": [noise, *further]}))
    cosim("variants", "drive", "--variant", "true.yaml", "--out", "measured", "--quiet")
    cosim(
        "diagnose",
        "measured/true",
        "--sensor",
        "believed.yaml",
        "--out",
        "diagnosis",
        "--json",
        "found.json",
        "--quiet",
    )
    assert json.loads((work / "found.json").read_text())["verdict"] == "missing"
    assert (work / "diagnosis/index.html").is_file() and (work / "diagnosis/sensor.yaml").is_file()
