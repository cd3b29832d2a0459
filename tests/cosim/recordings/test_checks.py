"""What is wrong with a recording is said before anything is fitted to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from cosim.drives.twin.scene import scene_instances
from cosim.recordings import RecordingError, Scan, open_recording
from cosim.recordings.checks import check_survey, missing_scans, survey_scans
from cosim.recordings.folder import name_numbers
from cosim.recordings.mapping.motion import motions
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.path_checks import check_path, check_sweep
from cosim.recordings.mapping.sweep import SweepEstimate
from sensors.pattern import Pattern, load_pattern
from sensors.tracing import Tracer
from tests.cosim.recordings.simulated import scans, yard

ELEVATIONS = np.array(load_pattern("vlp16").elevation_deg)


@dataclass(frozen=True)
class Held:
    """Scans in memory."""

    scans: list[Scan]
    path: Path = Path("recording")
    stamp_s: None = None
    poses: None = None

    def __iter__(self):
        return iter(self.scans)

    def __len__(self) -> int:
        return len(self.scans)

    def __getitem__(self, number: int) -> Scan:
        return self.scans[number]

    def between(self, first: int, last: int) -> Held:
        return Held(self.scans[first:last])

    def without_poses(self) -> Held:
        return self

    def turns(self, sweep_s: float) -> np.ndarray:
        return np.arange(len(self), dtype=float)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(f"{number:06d}" for number in range(len(self.scans)))


@pytest.fixture(scope="module")
def drive() -> list[Scan]:
    return scans(thin(load_pattern("vlp16")), "rings", count=8)


def thin(pattern: Pattern) -> Pattern:
    return pattern.model_copy(update={"firings": 300})


def said(result: list[Scan], *accepted: str) -> str:
    lines = np.column_stack([np.radians(ELEVATIONS), np.zeros(len(ELEVATIONS))])
    held = Held(result)
    try:
        return "; ".join(check_survey(held, survey_scans(held, lines), accepted))  # type: ignore[arg-type]
    except RecordingError as error:
        return f"refused: {error}"


def test_a_good_drive_passes(drive: list[Scan]) -> None:
    assert said(drive) == ""


def test_scans_doubled_are_refused_or_accepted(drive: list[Scan]) -> None:
    doubled = [scan for scan in drive[:4] for _ in range(2)]
    assert "4 of 8 scans are copies" in said(doubled) and "--accept copies" in said(doubled)
    assert said(doubled, "copies").startswith("scans 000000 and 000001")


@pytest.mark.parametrize("how", ["in turn", "one after the other"])
def test_two_sensors_are_refused(drive: list[Scan], how: str) -> None:
    others = scans(thin(load_pattern("vlp32c")), "rings", count=8)
    mixed = [drive[n] if (n % 2 if how == "in turn" else n < 4) else others[n] for n in range(8)]
    assert f"two sensors {how}" in said(mixed)


def test_a_laser_that_dies_is_named(drive: list[Scan]) -> None:
    found = []
    for number, scan in enumerate(drive * 2):
        off = np.abs(np.degrees(np.arctan2(scan.xyz[:, 2], scan.flat_range_m)) - ELEVATIONS[6])
        moved = Scan(scan.name, scan.xyz + 1e-5 * number)
        found.append(moved[off > 0.2] if number >= 8 else moved)
    assert "laser 7 of 16 from the top returns nothing from scan 000008 on" in said(found)


def test_intensities_that_some_scans_lack_are_refused(drive: list[Scan]) -> None:
    lit = [Scan(scan.name, scan.xyz, np.full(len(scan), 0.5, np.float32)) for scan in drive]
    assert said(lit) == ""
    assert "4 of 8 scans hold no intensities" in said([*lit[:4], *drive[4:]])


def test_numbers_in_names_say_which_scans_are_missing(tmp_path: Path) -> None:
    for number in (0, 1, 3, 6, 7):
        np.full((10, 4), 0.5, "<f4").tofile(tmp_path / f"{number:06d}.bin")
    recording = open_recording(tmp_path)
    assert "3 scans are missing by the numbers in names, the first between 000001 and 000003" in missing_scans(
        recording
    )
    np.testing.assert_allclose(recording.turns(0.1), [0, 1, 3, 6, 7])
    assert name_numbers(("1305031102175304", "1305031102275304")) is None, "stamps count no scans"


def trajectory(step: np.ndarray, count: int = 8, turns: np.ndarray | None = None) -> Trajectory:
    poses = np.tile(np.eye(4), (count, 1, 1))
    turns = np.arange(count, dtype=float) if turns is None else turns
    poses[:, :3, 3] = turns[:, None] * step
    return Trajectory(poses, motions(poses, turns), (), "made", turns)


def sweep(strength: float) -> SweepEstimate:
    return SweepEstimate(strength, strength - 0.1, strength + 0.1, np.array([strength]), (1.0, 0.6, 0.6), {})


@pytest.mark.parametrize(
    ("step", "strength", "words"),
    [
        ((-0.5, 0, 0), -1.0, "scans are in reverse order"),
        ((0.5, 0, 0), -1.0, "points are mirrored"),
        ((-0.5, 0, 0), 1.0, "--axes -x,-y,z"),
    ],
)
def test_points_that_move_against_the_path_have_a_reason(
    drive: list[Scan], step: tuple, strength: float, words: str
) -> None:
    held = Held(drive)
    with pytest.raises(RecordingError, match=words):
        check_sweep(held, trajectory(np.array(step)), sweep(strength))  # type: ignore[arg-type]
    assert check_sweep(held, trajectory(np.array([0.5, 0, 0])), sweep(1.0)) == []  # type: ignore[arg-type]


def test_a_path_along_y_names_the_axes(drive: list[Scan]) -> None:
    held = Held([drive[0]] * 8)
    with pytest.raises(RecordingError, match="--axes y,-x,z"):
        check_path(held, trajectory(np.array([0, 0.3, 0])))  # type: ignore[arg-type]


def test_another_location_is_named(drive: list[Scan]) -> None:
    turned = drive[0].xyz * [0.5, -1.0, 1.0] + [30.0, 12.0, 6.0]
    held = Held([drive[0]] * 5 + [Scan("x", turned)] * 3)
    with pytest.raises(RecordingError, match="scan 000005 shows another place than 000004"):
        check_path(held, trajectory(np.array([0.02, 0, 0])))  # type: ignore[arg-type]


def test_motions_over_missing_scans_are_those_of_one_sweep() -> None:
    found = trajectory(np.array([0.5, 0, 0]), 5, np.array([0.0, 1, 3, 6, 7]))
    np.testing.assert_allclose(found.motion[:, 3], 0.5, atol=1e-9)


def test_whether_points_are_compensated_needs_evidence() -> None:
    assert sweep(1.0).is_compensated == "no"
    unknown = SweepEstimate(0.6, -0.2, 1.4, np.array([0.6]), (0.9, 0.9, 0.9), {})
    assert unknown.is_compensated == "cannot be determined"
    freed = SweepEstimate(0.0, -0.1, 0.1, np.array([0.0]), (0.9, 0.9, 0.9), {})
    assert freed.is_compensated == "yes" and freed.scale == 0


def curve() -> tuple[Held, np.ndarray]:
    """Scans along a curve to the left through the yard, and their poses (n, 4, 4)."""
    pattern = thin(load_pattern("vlp16"))
    rays = pattern.rays()
    tracer, found, poses = Tracer(rays, pattern.range_m), [], np.tile(np.eye(4), (12, 1, 1))
    for number, pose in enumerate(poses):
        turn = number / 50
        pose[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
        pose[:2, 3] = 50 * np.sin(turn), 50 - 50 * np.cos(turn)
        reach = tracer.trace(yard(), pose, scene_instances(())).solid.range_m.astype(np.float64)
        rows = reach < pattern.range_m[1]
        found.append(Scan(f"{number:06d}", rays.direction[rows] * reach[rows, None]))
    return Held(found), poses


def test_given_poses_of_a_mirrored_path_are_refused() -> None:
    """A mirrored curve differs little from scan to scan, and clearly over several scans."""
    held, poses = curve()
    given = Trajectory(poses, motions(poses, np.arange(12.0)), (), "made", np.arange(12.0), False)
    assert check_path(held, given) == []  # type: ignore[arg-type]
    mirror = np.diag([1.0, -1.0, 1.0, 1.0])
    mirrored = mirror @ poses @ mirror
    wrong = Trajectory(mirrored, motions(mirrored, np.arange(12.0)), (), "made", np.arange(12.0), False)
    with pytest.raises(RecordingError, match="mirrored"):
        check_path(held, wrong)  # type: ignore[arg-type]
