"""From scans and a trajectory to a map: surfels, poses refined on them, gravity, what moves, and untouched scans."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from cosim.recordings.mapping.motion import applied, deskewed, nudged, scan_times
from cosim.recordings.mapping.moving import FreeSpace
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.surfels import Cloud, Surfels, SurfelSettings, cell_keys, make_surfels
from cosim.recordings.recording import Recording
from cosim.recordings.scan import RecordingError
from cosim.recordings.settings import Mount

_NEAREST_M, _FARTHEST_M = 2.0, 60.0
_MOST_POINTS = 4_000_000  # in the map; more make it slower and hardly better
_ROUNDS = 5  # of map and poses
_OUTLIER_M = 0.15
_HUBER_M = 0.03
_PRIOR = np.array([1e3, 1e3, 1e3, 1e2, 1e2, 1e2])  # holds what no surface holds
_HELD_SHARE, _HELD_FEWEST, _HELD_MOST = 0.1, 2, 20
_NEAR_PATH_M = 15.0
_BELOW_M = (0.3, 6.0)
_GROUND_BAND_M = 0.3
_SWEEP_SCANS = 30


@dataclass(frozen=True, eq=False)
class LocalScan:
    """The points of a scan that go into the map, in the sensor's axes at the pose time: (n, 3) and (n,) float32."""

    xyz: np.ndarray
    intensity: np.ndarray


@dataclass(frozen=True, eq=False)
class SurfelMap:
    """A map and how well it fits.

    Attributes:
        surfels: of what stands still, world axes: z up, ground about 0 under the first pose.
        left_out: surfels of what moves.
        poses: (n, 4, 4) of the sensor, all scans.
        pose_ego: (4, 4) of the sensor on the vehicle: x forward, z up, origin on the ground below it.
        ground: (m,) bool, which surfels are ground.
        held_out: numbers of scans that took no part.
        error_m: (n,) robust standard deviation of each scan's points across the surfels; NaN without any.
        on_map: (n,) share of each scan's points that lie in a surfel's cell.
        no_plane: cells with points enough that are no plane.
        rounds: thickness of ground and of walls [m] after each round of poses and map.
        mount_known: whether height and tilt come from the ground or the settings.
    """

    surfels: Surfels
    left_out: Surfels
    poses: np.ndarray
    pose_ego: np.ndarray
    ground: np.ndarray
    held_out: tuple[int, ...]
    error_m: np.ndarray
    on_map: np.ndarray
    no_plane: int
    rounds: tuple[tuple[float, float], ...]
    mount_known: bool


def held_out_scans(count: int) -> tuple[int, ...]:
    """The middle segment of a recording, where scans before and after show the same places."""
    size = min(max(round(_HELD_SHARE * count), _HELD_FEWEST), _HELD_MOST)
    first = (count - size) // 2
    return tuple(range(first, first + size)) if count >= 5 * _HELD_FEWEST else ()


def build_map(
    recording: Recording,
    trajectory: Trajectory,
    sweep_s: float,
    settings: SurfelSettings | None = None,
    mount: Mount | None = None,
    on_scan: Callable[[], object] = lambda: None,
) -> SurfelMap:
    """Make the map.

    Args:
        recording: scans in order.
        trajectory: their poses and motion.
        sweep_s: duration of a turn.
        settings: of surfels.
        mount: where the user says how the sensor sits.
        on_scan: called after each scan is read.

    Raises:
        RecordingError: the scans have no planes in common.
    """
    settings = settings or SurfelSettings()
    scans = _local_scans(recording, trajectory, sweep_s, on_scan)
    held = held_out_scans(len(scans))
    fitted = [number for number in range(len(scans)) if number not in held and len(scans[number].xyz)]
    poses, rounds = trajectory.poses.copy(), []
    surfels, no_plane = make_surfels(_cloud(scans, poses, fitted), settings)
    for _ in range(_ROUNDS):
        _demand_surfels(recording, surfels)
        rounds.append(thickness(surfels))
        for number in fitted[1:]:
            poses[number] = place(scans[number].xyz, poses[number], surfels, settings.cell_m, rounds=1)
        surfels, no_plane = make_surfels(_cloud(scans, poses, fitted), settings)
    up = _up(surfels, poses[fitted])
    poses, pose_ego, known = _levelled(surfels, poses, up, mount)
    surfels, no_plane = make_surfels(_cloud(scans, poses, fitted), settings)
    _demand_surfels(recording, surfels)
    rounds.append(thickness(surfels))
    space = FreeSpace(surfels)
    for number in fitted:
        space.add(scans[number].xyz, poses[number])
    moving = space.moving()
    still = surfels[~moving]
    for number in held:
        poses[number] = place(scans[number].xyz, poses[number], still, settings.cell_m, rounds=6)
    error, share = _errors(scans, poses, still, settings.cell_m)
    ground = _ground(still, poses, pose_ego[2, 3])
    return SurfelMap(
        still, surfels[moving], poses, pose_ego, ground, held, error, share, no_plane, tuple(rounds), known
    )


def thickness(surfels: Surfels) -> tuple[float, float]:
    """Median standard deviation across flat surfels, as of ground, and across all others, as of walls [m]."""
    level = surfels.level()
    return tuple(  # type: ignore[return-value]
        float(np.median(surfels.sd_m[rows])) if rows.any() else float("nan") for rows in (level, ~level)
    )


def place(xyz: np.ndarray, pose: np.ndarray, surfels: Surfels, cell_m: float, rounds: int) -> np.ndarray:
    """A scan's pose (4, 4) that brings its points (n, 3) best onto the surfels: point to plane, Huber's weights."""
    for _ in range(rounds):
        world = applied(pose, xyz)
        row = surfels.rows_of(cell_keys(world, cell_m))
        on = np.flatnonzero(row >= 0)
        normal = surfels.normal[row[on]]
        off = np.einsum("ij,ij->i", world[on] - surfels.centre[row[on]], normal)
        near = np.abs(off) < _OUTLIER_M
        on, normal, off = on[near], normal[near], off[near]
        if len(on) < 50:
            return pose
        weight = np.minimum(1.0, _HUBER_M / np.maximum(np.abs(off), 1e-9))
        slope = np.concatenate([np.cross(world[on] - pose[:3, 3], normal), normal], 1)
        matrix = (slope * weight[:, None]).T @ slope + np.diag(_PRIOR)
        pose = nudged(pose, np.linalg.solve(matrix, -(slope * weight[:, None]).T @ off))
    return pose


def _local_scans(
    recording: Recording, trajectory: Trajectory, sweep_s: float, on_scan: Callable[[], object]
) -> list[LocalScan]:
    scans: list[LocalScan] = []
    most = _MOST_POINTS // max(len(recording), 1)
    for number, scan in enumerate(recording):
        reach = np.linalg.norm(scan.xyz, axis=1)
        rows = np.flatnonzero((reach > _NEAREST_M) & (reach < _FARTHEST_M))
        rows = rows[:: max(1, -(-len(rows) // most))]
        taken = scan[rows]
        share = scan_times(taken.azimuth_rad, None, sweep_s) / sweep_s
        if scan.time_s is not None:
            share = (scan_times(scan.azimuth_rad, scan.time_s, sweep_s) / sweep_s)[rows]
        xyz = deskewed(taken.xyz, share, trajectory.motion[number]).astype(np.float32)
        bright = np.zeros(len(rows), np.float32) if taken.intensity is None else taken.intensity
        scans.append(LocalScan(xyz, bright))
        on_scan()
    return scans


def _cloud(scans: list[LocalScan], poses: np.ndarray, numbers: list[int]) -> Cloud:
    xyz, ray, reach = [], [], []
    for number in numbers:
        world = applied(poses[number], scans[number].xyz)
        beam = world - poses[number, :3, 3]
        away = np.linalg.norm(beam, axis=1)
        xyz.append(world.astype(np.float32))
        ray.append((beam / away[:, None]).astype(np.float32))
        reach.append(away.astype(np.float32))
    sizes = [len(part) for part in xyz]
    return Cloud(
        np.concatenate(xyz),
        np.repeat(np.array(numbers, np.int32), sizes),
        np.concatenate(reach),
        np.concatenate(ray),
        np.concatenate([scans[number].intensity for number in numbers]),
    )


def _demand_surfels(recording: Recording, surfels: Surfels) -> None:
    if len(surfels) < 50:
        raise RecordingError(
            f"{recording.path}: {len(surfels)} surfaces that three scans or more show as planes; a map needs "
            "hundreds: record ten scans or more among buildings or on a road, or give poses if odometry went astray"
        )


def _up(surfels: Surfels, poses: np.ndarray) -> np.ndarray:
    """The mean normal (3,) of the ground near the path, in the axes of the map."""
    near = KDTree(poses[:, :2, 3]).query(surfels.centre[:, :2])[0] < _NEAR_PATH_M
    ground = near & surfels.level()
    if ground.sum() < 20:
        return np.array([0.0, 0.0, 1.0])
    mean = (surfels.normal[ground] * surfels.points[ground, None]).sum(0)
    return mean / np.linalg.norm(mean)


def _levelled(
    surfels: Surfels, poses: np.ndarray, up: np.ndarray, mount: Mount | None
) -> tuple[np.ndarray, np.ndarray, bool]:
    """Poses in a world with z up and ground about 0, the sensor's pose on the vehicle, and whether it is known."""
    turn = np.eye(4)
    turn[:3, :3] = _tilt_to_z(up)
    poses = turn @ poses
    if mount is not None:
        height, known = mount.height_m, True
        tilt = Rotation.from_euler("yx", [mount.pitch_deg, mount.roll_deg], degrees=True).as_matrix()
    else:
        tilt = _tilt_to_z(np.mean(poses[:, 2, :3], axis=0))
        found = _height(surfels, poses, turn)
        height, known = (found, True) if found is not None else (1.8, False)
    pose_ego = np.eye(4)
    pose_ego[:3, :3], pose_ego[2, 3] = tilt, height
    poses[:, 2, 3] += height - poses[0, 2, 3]
    return poses, pose_ego, known


def _tilt_to_z(up: np.ndarray) -> np.ndarray:
    """The smallest rotation (3, 3) that carries a direction to z."""
    up = up / np.linalg.norm(up)
    axis = np.cross(up, [0.0, 0.0, 1.0])
    length = float(np.linalg.norm(axis))
    return Rotation.from_rotvec(axis / max(length, 1e-12) * np.arctan2(length, up[2])).as_matrix()


def _height(surfels: Surfels, poses: np.ndarray, turn: np.ndarray) -> float | None:
    """Height of the sensor above the ground about its path [m]; None where there is no ground."""
    centre = surfels.centre @ turn[:3, :3].T
    away, row = KDTree(poses[:, :2, 3]).query(centre[:, :2])
    below = poses[row, 2, 3] - centre[:, 2]
    rows = (away < _NEAR_PATH_M) & surfels.level() & (below > _BELOW_M[0]) & (below < _BELOW_M[1])
    if rows.sum() < 20:
        return None
    counts, edges = np.histogram(
        below[rows], np.arange(_BELOW_M[0], _BELOW_M[1] + 0.1, 0.1), weights=surfels.points[rows]
    )
    usual = edges[counts.argmax()] + 0.05
    return float(np.median(below[rows][np.abs(below[rows] - usual) < 0.15]))


def _ground(surfels: Surfels, poses: np.ndarray, height_m: float) -> np.ndarray:
    """(m,) bool: flat surfels at the ground's height below the nearest pose, farther ones within a slope of 1 in 20."""
    away, row = KDTree(poses[:, :2, 3]).query(surfels.centre[:, :2])
    above = surfels.centre[:, 2] - (poses[row, 2, 3] - height_m)
    return surfels.level() & (np.abs(above) < _GROUND_BAND_M + 0.05 * away)


def _errors(
    scans: list[LocalScan], poses: np.ndarray, surfels: Surfels, cell_m: float
) -> tuple[np.ndarray, np.ndarray]:
    error, share = np.full(len(scans), np.nan), np.zeros(len(scans))
    for number, scan in enumerate(scans):
        world = applied(poses[number], scan.xyz)
        row = surfels.rows_of(cell_keys(world, cell_m))
        on = row >= 0
        if on.sum() < 50:
            continue
        off = np.einsum("ij,ij->i", world[on] - surfels.centre[row[on]], surfels.normal[row[on]])
        off = off[np.abs(off) < _OUTLIER_M]
        error[number] = 1.4826 * np.median(np.abs(off))
        share[number] = on.mean()
    return error, share


def sweep_thickness(
    recording: Recording, trajectory: Trajectory, sweep_s: float, settings: SurfelSettings, scales: tuple[float, ...]
) -> dict[float, float]:
    """Thickness of walls and ground [m] with the sensor's motion in a sweep taken so many times as strong.

    A map of some scans in the middle is made anew for each; it is thinnest where the motion is right.
    """
    count = min(len(recording), _SWEEP_SCANS)
    first = (len(recording) - count) // 2
    part = recording.between(first, first + count)
    found = {}
    for scale in scales:
        rows = slice(first, first + count)
        own = replace(trajectory, poses=trajectory.poses[rows], motion=scale * trajectory.motion[rows])
        scans = _local_scans(part, own, sweep_s, lambda: None)
        numbers = [number for number in range(count) if len(scans[number].xyz)]
        poses = own.poses.copy()
        surfels, _ = make_surfels(_cloud(scans, poses, numbers), settings)
        for number in numbers[1:]:
            poses[number] = place(scans[number].xyz, poses[number], surfels, settings.cell_m, rounds=2)
        surfels, _ = make_surfels(_cloud(scans, poses, numbers), settings)
        found[scale] = float(np.median(surfels.sd_m)) if len(surfels) else float("nan")
    return found
