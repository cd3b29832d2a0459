"""Long recordings are mapped in segments, whose worlds are held together by the scans that neighbours share."""

from __future__ import annotations

import json
import shutil
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cosim.cli import main
from cosim.drives.kitti import Drive
from cosim.recordings.mapping.doubts import frames_of
from cosim.recordings.mapping.kept import Kept
from cosim.recordings.mapping.segments import segments_of, together
from sensors.pattern import load_pattern
from tests.cosim.recordings.test_twin import path, record
from tests.sharing import made_once

SCANS = 44


@pytest.mark.parametrize("count", [5, 300, 301, 2000, 36000])
def test_every_scan_is_one_segments_own_and_neighbours_share_some(count: int) -> None:
    segments = segments_of(count)
    own = np.concatenate([np.arange(one.begin, one.end) for one in segments])
    np.testing.assert_array_equal(own, np.arange(count))
    assert max(map(len, segments)) <= 300
    for before, after in pairwise(segments):
        assert before.last - after.first >= 20


def test_paths_in_worlds_of_their_own_join_to_one() -> None:
    rng, whole, segments = np.random.default_rng(0), path(700), segments_of(700)
    parts = []
    for number, one in enumerate(segments):
        world = np.eye(4)
        if number:
            world[:3, :3], world[:3, 3] = Rotation.from_rotvec(rng.normal(0, 1, 3)).as_matrix(), rng.normal(0, 9, 3)
        parts.append(world @ whole[one.first : one.last])
    np.testing.assert_allclose(together(segments, parts), whole, atol=1e-6)


def test_a_file_of_something_else_or_cut_off_is_made_anew(tmp_path: Path) -> None:
    made, segments = [], segments_of(700)

    def kept(about: str) -> Kept:
        return Kept(tmp_path, "part", about, lambda segment, _: made.append(segment.number) or {"x": np.zeros(3)})

    kept("one").all_made(segments)
    kept("one").all_made(segments)
    assert made == [one.number for one in segments]
    file = kept("one").file(segments[1])
    file.write_bytes(file.read_bytes()[:-20])
    kept("one").all_made(segments)
    assert made[len(segments) :] == [1]
    kept("two").all_made(segments)
    assert len(made) == 2 * len(segments) + 1


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A twin in two segments of forty-four scans by two processes: `scans/`, `twin/` and `twin.json` in one folder."""
    pytest.importorskip("kiss_icp")

    def make(folder: Path) -> None:
        record(folder / "scans", path(SCANS), load_pattern("vlp16"))
        (folder / "scans/recording.yaml").write_text("segment_scans: 20\n")
        command = ["twin", str(folder / "scans"), "--out", str(folder / "twin"), "--json", str(folder / "twin.json")]
        assert main([*command, "--workers", "2", "--quiet"]) == 0

    return made_once(tmp_path_factory, "long_recording_twin", make)


@pytest.mark.slow
def test_frames_lie_in_the_world_of_their_segment(twin: Path) -> None:
    drive, report = Drive(twin / "twin"), json.loads((twin / "twin.json").read_text())
    assert (
        report["segments"] == 2 and report["scans"] == SCANS and any("2 segments" in note for note in report["notes"])
    )
    worlds = [frame.twin.static for frame in drive]
    assert worlds == sorted(worlds) and set(worlds) == {"worlds/segment_0000.glb", "worlds/segment_0001.glb"}
    assert report["error_held_out_m"] < 0.04 and not (twin / "twin-segments").exists()


@pytest.mark.slow
def test_a_diagnosis_uses_scans_of_every_segment(twin: Path, tmp_path: Path) -> None:
    from cosim.discrepancy.data.split import split_drive

    split, drive = split_drive(Drive(twin / "twin"), 28_800), Drive(twin / "twin")
    for names in (split.fit, split.test):
        assert len({drive[name].twin.static for name in names}) == 2
    sensor = tmp_path / "sensor.yaml"
    shutil.copy(twin / "twin/pattern.yaml", tmp_path / "pattern.yaml")
    sensor.write_text("pattern: pattern.yaml\neffects:\n  - {effect: range_noise, sigma_m: 0.02}\n")
    out = ["--json", str(tmp_path / "told.json"), "--out", str(tmp_path / "page")]
    assert main(["compare", str(twin / "twin"), "--sensor", str(sensor), *out, "--quiet"]) == 0
    assert json.loads((tmp_path / "told.json").read_text())["channels"]["range"]["rmse_m"] < 0.2


def test_segments_whose_path_jumps_or_stands_are_looked_at_only_where_there_are_no_others() -> None:
    each, names = 10, [f"{number:06d}" for number in range(30)]
    made: Any = SimpleNamespace(
        mapped=np.ones(3, bool),
        segment_of=np.repeat(np.arange(3), each),
        fitted=tuple(range(30)),
        held_out=(),
        on_map=np.ones(30),
        held=np.ones(30),
    )

    def looked_at(*paths: tuple[bool, tuple[int, ...]]) -> list[int]:
        all_paths = [SimpleNamespace(standing=standing, doubtful=jumps) for standing, jumps in paths]
        prepared: Any = SimpleNamespace(paths=all_paths, path=SimpleNamespace(from_odometry=True))
        return [int(own[0]) // each for own in frames_of(prepared, made, names)[0]]

    assert looked_at((False, ()), (False, (4,)), (True, ())) == [0]
    assert looked_at((True, ()), (False, (4,)), (False, (2, 3))) == [1, 2]
    assert looked_at((True, ()), (True, ()), (True, ())) == [0, 1, 2]
