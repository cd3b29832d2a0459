"""From scans and a trajectory to a map: surfels, poses refined on them, gravity, what moves, and held-out scans.

Registration of a scan to planes is not determined along a direction without normals: along a tunnel, or across an open
plain (Zhang, Kaess, Singh, On degeneracy of optimization-based state estimation problems, ICRA 2016). Odometry does not
report a failure there: the rings on walls travel with the sensor, so that it finds no motion, and the resulting map is
sharp. Therefore `holding` takes normals of patches that several lasers hit in a single scan.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.drives.twin.surfels import cell_keys
from cosim.recordings.mapping.adjust import OUTLIER_M, adjusted, place, placed_in_turn
from cosim.recordings.mapping.level import ground, levelled, up
from cosim.recordings.mapping.motion import applied, motions
from cosim.recordings.mapping.moving import FreeSpace, looked_at
from cosim.recordings.mapping.normals import planes
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.scans import cloud_of, local_scans
from cosim.recordings.mapping.surfels import Surfels, SurfelSettings, make_surfels, solid_shares
from cosim.recordings.recording import Recording
from cosim.recordings.scan import RecordingError
from cosim.recordings.settings import RecordingMount

_ROUNDS = 4  # of map and poses
_HELD_PARTS, _HELD_LONG = 6, 30
_HELD_SHARE, _HELD_FEWEST, _HELD_MOST = 0.2, 2, 24
_FEWEST_SURFELS, _FEWEST_ON_MAP = 50, 50
_SOLID, _WELL_SEEN = 0.9, 4  # share of the points about a surfel that lie on it, and scans, to be trusted
_PATCH_DEG = (6.0, 5.0)  # azimuth and elevation; in 5° of elevation every sensor has two lasers or more
_PATCH_POINTS, _PATCH_SPREAD_DEG = 15, 0.3  # of a patch, and of its points' elevations: one laser draws no plane
_PLANE_THICKNESS_M, _PLANE_SHAPE = 0.05, 4.0  # across a plane, and times that along it
_PLANES_SHARE = 0.8  # share of points on planes: 0.85 and more in bare tunnels; streets have 0.7, and much that holds


class NoMapError(RecordingError):
    """The scans have no planes in common."""


@dataclass(frozen=True, eq=False)
class BuiltMap:
    """A map and how well it fits.

    Attributes:
        surfels: surfels of static surfaces, world axes: z up, ground about 0 under the first pose.
        left_out: surfels of what moves.
        poses: (n, 4, 4) of the sensor, all scans.
        motion: (n, 6) of the sensor in a sweep, see `motion.between`.
        pose_ego: (4, 4) of the sensor on the vehicle: x forward, z up, origin on the ground below it.
        ground: (m,) bool, which surfels are ground.
        trusted: (m,) bool, which are seen so often, by beams of several elevations, and have so little else about them,
            that beams may be compared.
        held_out: numbers of scans that took no part.
        error_m: (n,) robust standard deviation of each scan's points across the surfels; NaN without any.
        on_map: (n,) share of each scan's points that lie in a surfel's cell.
        held: (n,) how firmly what each scan sees holds it in place, see `holding`.
        no_plane: cells with points enough that are no plane.
        rounds: thickness of ground and of walls [m] after each round of poses and map.
        mount_known: whether height and tilt come from the ground or the settings.
    """

    surfels: Surfels
    left_out: Surfels
    poses: np.ndarray
    motion: np.ndarray
    pose_ego: np.ndarray
    ground: np.ndarray
    trusted: np.ndarray
    held_out: tuple[int, ...]
    error_m: np.ndarray
    on_map: np.ndarray
    held: np.ndarray
    no_plane: int
    rounds: tuple[tuple[float, float], ...]
    mount_known: bool


def held_out_scans(count: int) -> tuple[int, ...]:
    """Segments of a recording, where scans before and after show the same places: six of long ones, else the middle.

    Places far from each other show one surface from near and far.
    """
    size = min(max(round(_HELD_SHARE * count), _HELD_FEWEST), _HELD_MOST)
    if count < 5 * _HELD_FEWEST:
        return ()
    parts = _HELD_PARTS if count >= _HELD_LONG else 1
    each = max(size // parts, 1)
    firsts = [round((2 * part + 1) * count / (2 * parts) - each / 2) for part in range(parts)]
    return tuple(first + step for first in firsts for step in range(each))


def build_map(
    recording: Recording,
    trajectory: Trajectory,
    sweep_s: float,
    settings: SurfelSettings | None = None,
    mount: RecordingMount | None = None,
    sweep_scale: float = 1.0,
    on_scan: Callable[[], object] = lambda: None,
) -> BuiltMap:
    """Make the map.

    Args:
        recording: scans in order.
        trajectory: their poses and motion.
        sweep_s: duration of a turn.
        settings: of surfels.
        mount: where the user says how the sensor sits.
        sweep_scale: share of the sensor's motion in a sweep that points are freed of; 0 where they are already.
        on_scan: called after each scan is read, and after each round.

    Raises:
        NoMapError: the scans have no planes in common.
    """
    settings = settings or SurfelSettings()
    scans = local_scans(recording, sweep_s, on_scan)
    held = held_out_scans(len(scans))
    fitted = [number for number in range(len(scans)) if number not in held and len(scans[number])]
    poses, motion, rounds = trajectory.poses, trajectory.motion, []
    if trajectory.from_odometry:
        poses = placed_in_turn(scans, poses, sweep_scale * motion, fitted)
        on_scan()
    for _ in range(_ROUNDS):
        motion = motions(poses, trajectory.turns)
        surfels, _ = make_surfels(cloud_of(scans, poses, sweep_scale * motion, fitted), settings)
        _demand_surfels(recording, surfels)
        rounds.append(thickness(surfels))
        poses = adjusted(scans, poses, sweep_scale * motion, fitted, surfels, settings.cell_m)
        on_scan()
    poses, pose_ego, known = levelled(surfels, poses, up(surfels, poses[fitted]), mount)
    cloud = cloud_of(scans, poses, sweep_scale * motion, fitted)
    surfels, no_plane = make_surfels(cloud, settings, steady=True)
    _demand_surfels(recording, surfels)
    rounds.append(thickness(surfels))
    solid = (solid_shares(cloud, surfels, settings.cell_m) > _SOLID) & (surfels.scans >= _WELL_SEEN)
    solid &= surfels.of_several_lasers(settings)
    del cloud
    on_scan()
    local = [scan.at_pose_time(sweep_scale * own) for scan, own in zip(scans, motion, strict=True)]
    space = FreeSpace(surfels, looked_at(local[number] for number in fitted))
    for number in fitted:
        space.add(local[number], poses[number])
    moving = space.moving()
    still = surfels[~moving]
    for number in held:
        poses[number] = place(local[number], poses[number], still, settings.cell_m, rounds=6)
    error, share = _errors(local, poses, still, settings.cell_m)
    return BuiltMap(
        surfels=still,
        left_out=surfels[moving],
        poses=poses,
        motion=motions(poses, trajectory.turns),
        pose_ego=pose_ego,
        ground=ground(still, poses, pose_ego[2, 3]),
        trusted=solid[~moving],
        held_out=held,
        error_m=error,
        on_map=share,
        held=np.array([holding(xyz) for xyz in local]),
        no_plane=no_plane,
        rounds=tuple(rounds),
        mount_known=known,
    )


def thickness(surfels: Surfels) -> tuple[float, float]:
    """Median standard deviation across flat surfels, as of ground, and across all others, as of walls [m]."""
    level = surfels.level()
    return tuple(  # type: ignore[return-value]
        float(np.median(surfels.sd_m[rows])) if rows.any() else float("nan") for rows in (level, ~level)
    )


def _demand_surfels(recording: Recording, surfels: Surfels) -> None:
    if len(surfels) < _FEWEST_SURFELS:
        raise NoMapError(
            f"{recording.path}: {len(surfels)} surfaces that three scans or more show as planes; a map needs "
            "hundreds: record ten scans or more among buildings or on a road, or give poses if odometry went astray"
        )


def _errors(
    local: Sequence[np.ndarray], poses: np.ndarray, surfels: Surfels, cell_m: float
) -> tuple[np.ndarray, np.ndarray]:
    error, share = np.full(len(local), np.nan), np.zeros(len(local))
    for number, xyz in enumerate(local):
        world = applied(poses[number], xyz)
        row = surfels.rows_of(cell_keys(world, cell_m))
        on = row >= 0
        if on.sum() < _FEWEST_ON_MAP:
            continue
        off = np.einsum("ij,ij->i", world[on] - surfels.centre[row[on]], surfels.normal[row[on]])
        off = off[np.abs(off) < OUTLIER_M]
        error[number] = 1.4826 * np.median(np.abs(off))
        share[number] = on.mean()
    return error, share


def holding(xyz: np.ndarray) -> float:
    """Smallest eigenvalue of the information about a scan's position, from 0 to 1/3.

    The smallest eigenvalue of the mean of n·nᵀ over points on planes of normals n; 1/3 where a fifth of the points
    lies on none, as corners, cars and poles hold a scan, too.

    Args:
        xyz: (n, 3) points in the sensor's axes.
    """
    patch, elevation = _patches(xyz)
    count = np.bincount(patch)
    _, normal, variance = planes(xyz, patch, len(count))
    sd = np.sqrt(variance)
    spread = np.sqrt(_variance(elevation, patch))
    good = (count >= _PATCH_POINTS) & (spread > np.radians(_PATCH_SPREAD_DEG))
    points = float(count[good].sum())
    good &= (sd[:, 0] < _PLANE_THICKNESS_M) & (sd[:, 1] > _PLANE_SHAPE * sd[:, 0])
    on = float(count[good].sum())
    if not points or on < _PLANES_SHARE * points:
        return 1 / 3
    weighted = normal[good] * count[good, None]
    return float(np.linalg.eigvalsh(weighted.T @ normal[good])[0] / on)


def _patches(xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Number of each point's patch (n,) from 0, and its elevation (n,) [rad]."""
    elevation = np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])).astype(np.float64)
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    wide, high = np.radians(_PATCH_DEG)
    cell = np.floor(azimuth / wide).astype(int) * 1000 + np.floor(elevation / high).astype(int)
    return np.unique(cell, return_inverse=True)[1].reshape(-1), elevation


def _variance(values: np.ndarray, patch: np.ndarray) -> np.ndarray:
    count = np.bincount(patch)
    rest = values - (np.bincount(patch, values) / count)[patch]
    return np.bincount(patch, rest**2) / count
