"""Fixtures shared by all tests."""

from __future__ import annotations

import json
import lzma
import os
import shutil
from pathlib import Path

import pytest
import yaml

from tests.sharing import made_once, record

# Test processes run side by side: threads of libraries would mostly wait for each other, and turn while they wait.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

_REAL_FRAMES = 3
_CONFIG = "town: town01\nseed: 3\nframes: 8\nframes_per_episode: 4\ncollection: {every_s: 2.0}\nwarm_up_s: 45\n"


@pytest.fixture(scope="session")
def kitti_source() -> Path:
    """The folder of real KITTI measurements: COSIM_KITTI, or shared/kitti next to the repository."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "kitti"
    source = Path(os.environ.get("COSIM_KITTI", beside))
    if not (source / "velodyne").is_dir():
        pytest.skip(f"no real KITTI frames at {source}; set COSIM_KITTI to a folder of them")
    return source


@pytest.fixture(scope="session")
def kitti_root(kitti_source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A few real frames that have images, in KITTI's ordinary layout."""
    root = tmp_path_factory.mktemp("kitti")
    images = sorted((kitti_source / "image_2").glob("*.png"))[:_REAL_FRAMES]
    if not images:
        pytest.skip(f"no image_2/ in {kitti_source}: nothing to hold projections against")
    for image in images:
        for part, suffix in (("image_2", ".png"), ("label_2", ".txt"), ("calib", ".txt")):
            target = root / "training" / part / (image.stem + suffix)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(kitti_source / part / target.name, target)
        scan = root / "training" / "velodyne" / f"{image.stem}.bin"
        scan.parent.mkdir(exist_ok=True)
        packed = kitti_source / "velodyne" / f"{image.stem}.bin.xz"
        plain = kitti_source / "velodyne" / scan.name
        scan.write_bytes(lzma.decompress(packed.read_bytes()) if packed.exists() else plain.read_bytes())
    (root / "ImageSets").mkdir()
    names = [image.stem for image in images]
    (root / "ImageSets" / "train.txt").write_text("\n".join([*names[:2], "999999"]) + "\n")
    (root / "ImageSets" / "val.txt").write_text(names[2] + "\n" if len(names) > 2 else "")
    return root


@pytest.fixture(scope="session")
def run_config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A configuration of two short episodes."""
    path = tmp_path_factory.mktemp("config") / "run.yaml"
    path.write_text(_CONFIG)
    return path


@pytest.fixture(scope="session")
def drive_folder(run_config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive it gives: 64 lasers in town01. Shared by all processes: to be read, not written."""
    return made_once(tmp_path_factory, "drive_folder", lambda folder: record(run_config, folder / "drive")) / "drive"


@pytest.fixture(scope="session")
def source_drive(drive_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A later frame of each of its two episodes; its files are links."""

    def thin_out(folder: Path) -> None:
        shutil.copytree(drive_folder, folder / "drive", copy_function=os.link)
        manifest = folder / "drive" / "manifest.jsonl"
        entries = [json.loads(line) for line in manifest.read_text().splitlines()]
        manifest.unlink()
        left_out = [entry for entry in entries if "name" in entry and int(entry["name"]) % 4 != 2]
        for file in (file for entry in left_out for file in entry["files"]):
            (folder / "drive" / file).unlink()
        kept = [entry for entry in entries if entry not in left_out]
        manifest.write_text("".join(json.dumps(entry) + "\n" for entry in kept))

    return made_once(tmp_path_factory, "source_drive", thin_out) / "drive"


@pytest.fixture(scope="session")
def hamlet_config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A configuration of two short episodes of a scanner of 16 lasers in a town of four streets."""
    from tests.cosim.hamlet import write_hamlet

    return made_once(tmp_path_factory, "hamlet", write_hamlet) / "run.yaml"


@pytest.fixture(scope="session")
def hamlet_drive(hamlet_config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive it gives. Shared by all processes: to be read, not written."""
    return made_once(tmp_path_factory, "hamlet_drive", lambda folder: record(hamlet_config, folder / "drive")) / "drive"


@pytest.fixture(scope="session")
def blind_config(hamlet_config: Path) -> Path:
    """The same without images, for tests of files and processes."""
    path = hamlet_config.with_name("blind.yaml")
    path.write_text(yaml.safe_dump(yaml.safe_load(hamlet_config.read_text()) | {"images": []}))
    return path


@pytest.fixture(scope="session")
def blind_drive(blind_config: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The drive it gives. Shared by all processes: to be read, not written."""
    return made_once(tmp_path_factory, "blind_drive", lambda folder: record(blind_config, folder / "drive")) / "drive"
