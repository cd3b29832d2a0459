"""A recording as a drive with a twin: its scans ring by ring, their poses, and the map they were taken in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from assets.materials import MATERIALS
from assets.mesh import Mesh
from cosim.drives.kitti.points import encode_points
from cosim.drives.kitti.rays import PointRays, encode_rays
from cosim.drives.twin import Ego, Lidar, TwinFrame, encode_glb, format_materials
from cosim.drives.writer import DriveWriter, OutputError
from cosim.recordings.mapping.build import SurfelMap, build_map, sweep_thickness
from cosim.recordings.mapping.correction import Correction
from cosim.recordings.mapping.motion import scan_times
from cosim.recordings.mapping.odometry import Trajectory, find_trajectory
from cosim.recordings.mapping.surfels import SurfelSettings, quads
from cosim.recordings.pattern.find import FoundPattern, beams_of, find_pattern
from cosim.recordings.recording import Recording
from cosim.recordings.scan import RecordingError, Scan
from sensors.effects.base import Effect
from sensors.npz import npz_bytes
from sensors.pattern import Pattern, load_pattern

GROUND, WALL = "asphalt", "concrete"
_SAME_LASER_DEG = 0.4  # between a laser of the given pattern and one that the points show
_SWEEP_SCALES = (-1.0, 0.0, 0.5, 1.0, 1.5)
_FEWEST_SCANS, _FEW_SCANS = 5, 20
_LOST_SHARE = 0.5  # of the usual share of points on the map: below, a scan's pose is doubtful
_CAMERALESS = "A recording has no cameras: there is no calibration here.\n"


@dataclass(frozen=True, eq=False)
class RecordingTwin:
    """What was made of a recording.

    Attributes:
        folder: the drive.
        recording: what it was made of.
        names: of its frames, in order.
        pattern: beams were told apart with.
        found: what the points show of the pattern.
        trajectory: before the map refined it.
        made: the map.
        sweep_m: thickness of the map with the sweep's motion taken so many times as strong.
        notes: what is missing, doubtful or cannot be told, a sentence each.
    """

    folder: Path
    recording: Path
    names: tuple[str, ...]
    pattern: Pattern
    found: FoundPattern
    trajectory: Trajectory
    made: SurfelMap
    sweep_m: dict[float, float]
    notes: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        made, held = self.made, list(self.made.held_out)
        fitted = [number for number in range(len(self.names)) if number not in held]
        return {
            "out": str(self.folder),
            "scans": len(self.names),
            "poses": self.trajectory.source,
            "path_m": round(self.trajectory.path_m, 3),
            "lasers": len(self.found.lasers),
            "surfels": len(made.surfels),
            "surfels_ground": int(made.ground.sum()),
            "surfels_trusted": int(made.trusted.sum()),
            "surfels_moving": len(made.left_out),
            "cells_without_plane": made.no_plane,
            "thickness_ground_m": round(_middle(made.surfels.sd_m[made.ground]), 5),
            "thickness_walls_m": round(_middle(made.surfels.sd_m[~made.surfels.level()]), 5),
            "thickness_by_sweep_scale_m": {f"{scale:g}": round(value, 5) for scale, value in self.sweep_m.items()},
            "held_out": [self.names[number] for number in held],
            "error_fitted_m": round(_middle(made.error_m[fitted]), 5),
            "error_held_out_m": round(_middle(made.error_m[held]), 5) if held else None,
            "points_on_map_share": round(float(np.median(made.on_map)), 4),
            "mount": {"height_m": round(float(made.pose_ego[2, 3]), 4), "from_ground": made.mount_known},
            "notes": list(self.notes),
        }


@dataclass(frozen=True, eq=False)
class Prepared:
    """What a map needs to know of a recording beside its points.

    Attributes:
        recording: as it is.
        pattern: beams are told apart with.
        found: what the points show of the pattern.
        ring_of: (k,) ring of the pattern for each laser that the points show.
        trajectory: of the sensor.
        sweep_m: thickness of a map of some scans, with the sweep's motion taken so many times as strong.
        sweep_scale: how strong it is, 0 or 1: whether points were freed of it before.
    """

    recording: Recording
    pattern: Pattern
    found: FoundPattern
    ring_of: np.ndarray
    trajectory: Trajectory
    sweep_m: dict[float, float]
    sweep_scale: float


def prepare(
    recording: Recording, pattern: Pattern | str | None = None, on_step: Callable[[str], None] = lambda words: None
) -> Prepared:
    """Pattern, path and motion in a sweep of a recording.

    Args:
        recording: scans in order.
        pattern: the beam pattern, its name or its path; found in the points by default.
        on_step: told what is done next.

    Raises:
        RecordingError: fewer than five scans, no map in them, or another pattern than the given.
        SensorError: no such pattern.
    """
    if len(recording) < _FEWEST_SCANS:
        raise RecordingError(
            f"{recording.path}: {len(recording)} scans; a map needs five at least, and some dozens to be good"
        )
    on_step("pattern")
    found = find_pattern(recording, "recording")
    given = load_pattern(pattern) if isinstance(pattern, str) else pattern
    beams = given or found.pattern
    ring_of = _rings(found, beams, beams.name)
    on_step("odometry")
    trajectory = find_trajectory(recording, beams.sweep_s)
    on_step("sweep motion")
    scales = () if trajectory.standing else _SWEEP_SCALES
    sweep = sweep_thickness(recording, trajectory, beams.sweep_s, SurfelSettings(), scales)
    return Prepared(recording, beams, found, ring_of, trajectory, sweep, float(_likeliest_scale(sweep) > 0.5))


def write_recording_twin(
    recording: Recording,
    folder: Path,
    pattern: str | None = None,
    on_step: Callable[[str], None] = lambda words: None,
) -> RecordingTwin:
    """Make a drive with a twin of a recording; frames that an interrupted run left are kept.

    Args:
        recording: scans in order.
        folder: of the new drive.
        pattern: name or path of the beam pattern; found in the points by default.
        on_step: told what is done next.

    Raises:
        RecordingError: fewer than five scans, no map in them, or another pattern than the given.
        OutputError: the folder cannot be used.
        SensorError: no such pattern.
    """
    if folder.resolve() == recording.path.resolve():
        raise OutputError(f"{folder} is the recording itself; choose another --out")
    return write_map_twin(prepare(recording, pattern, on_step), folder, (), on_step)


def write_map_twin(
    prepared: Prepared,
    folder: Path,
    effects: Sequence[Effect] = (),
    on_step: Callable[[str], None] = lambda words: None,
) -> RecordingTwin:
    """Make the map and write it with the scans as a drive.

    Args:
        prepared: the recording.
        folder: of the new drive.
        effects: of the sensor, as far as they are known: the map is made of points with these undone. The drive's
            own points stay as they were measured.
        on_step: told what is done next.

    Raises:
        RecordingError: no map in the scans.
        OutputError: the folder cannot be used.
    """
    recording, trajectory = prepared.recording, prepared.trajectory
    correction = Correction(prepared.pattern, prepared.found.lasers.lines, prepared.ring_of, tuple(effects))
    told = correction.sweep_scale()
    on_step("map")
    made = build_map(
        correction.of(recording),
        trajectory,
        prepared.pattern.sweep_s,
        mount=recording.settings.mount,
        sweep_scale=prepared.sweep_scale if told is None else told,
    )
    names = tuple(f"{number:06d}" for number in range(len(recording)))
    notes = (*recording.notes, *prepared.found.notes, *_notes(recording, trajectory, made, prepared.sweep_m))
    twin = RecordingTwin(
        folder,
        recording.path,
        names,
        prepared.pattern,
        prepared.found,
        trajectory,
        made,
        prepared.sweep_m,
        tuple(notes),
    )
    on_step("files")
    _write(twin, recording, prepared.ring_of)
    return twin


def _likeliest_scale(sweep: dict[float, float]) -> float:
    """How strong the sensor's motion in a sweep is where the map is thinnest, by a parabola; 1 if nothing tells."""
    told = {scale: value for scale, value in sweep.items() if np.isfinite(value)}
    if len(told) < 3:
        return 1.0
    scale, value = np.array(sorted(told.items())).T
    curve, slope, _ = np.polyfit(scale, value, 2)
    best = -slope / (2 * curve) if curve > 0 else scale[value.argmin()]
    return float(np.clip(best, scale[0], scale[-1]))


def _rings(found: FoundPattern, beams: Pattern, given: str) -> np.ndarray:
    """Ring of the pattern for each laser that the points show (k,).

    Raises:
        RecordingError: they are not the pattern's.
    """
    apart = np.abs(found.lasers.elevation_deg[:, None] - np.array(beams.elevation_deg))
    ring, off = apart.argmin(1), apart.min(1)
    if off.max() > _SAME_LASER_DEG or len(np.unique(ring)) < len(ring):
        row = int(off.argmax())
        raise RecordingError(
            f"pattern {given}: {beams.rings} lasers, none of them the one that points show at "
            f"{found.lasers.elevation_deg[row]:+.2f}° (of {len(found.lasers)}); leave --pattern out, or give its own"
        )
    return ring


def _notes(recording: Recording, trajectory: Trajectory, made: SurfelMap, sweep: dict[float, float]) -> list[str]:
    notes = [f"poses: {trajectory.source}"]
    if trajectory.standing:
        notes.append(
            f"the sensor moves {trajectory.extent_m:.2f} m in all, so each surface is seen from one place: sweep "
            "motion, and whatever changes with range or angle alone, cannot be told from the surfaces themselves"
        )
    elif sweep and min(sweep, key=lambda scale: sweep[scale]) <= 0:
        notes.append("the map is thinnest without the sweep's motion: scans look motion-compensated already")
    if len(recording) < _FEW_SCANS:
        notes.append(
            f"{len(recording)} scans only: few looks at every surface, so thickness and effects are poorly told"
        )
    if trajectory.doubtful:
        shown = ", ".join(recording.names[number] for number in trajectory.doubtful[:8])
        notes.append(f"the path jumps at {len(trajectory.doubtful)} scans ({shown}): odometry is doubtful there")
    lost = np.flatnonzero(made.on_map < _LOST_SHARE * np.median(made.on_map))
    if len(lost):
        shown = ", ".join(recording.names[number] for number in lost[:8])
        notes.append(f"{len(lost)} scans lie badly on the map ({shown}): their poses are doubtful")
    if not made.mount_known:
        notes.append("no ground was found: the sensor is taken to be 1.8 m above it; recording.yaml may say mount:")
    notes.append(
        "range_scale and a constant offset along all normals are not told by any drive: the map is made of these ranges"
    )
    notes.append("moving things and places without a plane are left out of the twin; objects are not modelled")
    return notes


def _write(twin: RecordingTwin, recording: Recording, ring_of: np.ndarray) -> None:
    writer = DriveWriter(twin.folder)
    settings = {
        "kind": "measured",
        "source": str(recording.path.resolve()),
        "twin": "map",
        "pattern": twin.pattern.name,
        "scans": len(recording),
    }
    head = yaml.safe_dump(settings | {"cosim": version("cosim")}, sort_keys=False)
    writer.open(head)
    done = writer.manifest()
    writer.write_once("calib/README.txt", _CAMERALESS.encode())
    to_lidar = np.linalg.inv(twin.made.pose_ego)
    interval_s = recording.interval_s or twin.pattern.sweep_s
    for number, name in enumerate(twin.names):
        if name in done:
            continue
        ego = twin.made.poses[number] @ to_lidar
        stamp = recording.stamp_s
        time_s = number * interval_s if stamp is None else float(stamp[number] - stamp[0])
        frame = _frame(twin, name, ego, twin.made.motion[number], time_s)
        scan = recording[number]
        which = beams_of(scan, twin.found.lasers.lines)
        points, rays = _ordered(scan, which, ring_of, twin.pattern)
        files = {
            f"velodyne/{name}.bin": encode_points(points),
            f"rays/{name}.npz": encode_rays(rays),
            f"twin/frames/{name}.json": frame.to_json().encode(),
        }
        held = int(number in twin.made.held_out)
        writer.write_frame(
            name, files, {"points": len(points), "points_off_beam": int((which < 0).sum()), "held_out": held}
        )
    _finish(twin, writer, head)


def _frame(twin: RecordingTwin, name: str, ego: np.ndarray, motion: np.ndarray, time_s: float) -> TwinFrame:
    """The frame's poses, and the vehicle's motion from that of the sensor in a sweep."""
    sweep_s = twin.pattern.sweep_s
    lidar = ego @ twin.made.pose_ego
    velocity = lidar[:3, :3] @ motion[3:] / sweep_s
    spin = lidar[:3, :3] @ motion[:3] / sweep_s
    velocity = velocity - np.cross(spin, lidar[:3, 3] - ego[:3, 3])  # of the vehicle's origin, below the sensor
    return TwinFrame(
        frame=name,
        time_s=time_s,
        sweep_s=sweep_s,
        ego=Ego(ego, velocity, float(spin[2]), np.zeros(3)),
        lidar=Lidar(twin.made.pose_ego, twin.pattern.name),
        cameras={},
        instances=(),
    )


def _ordered(scan: Scan, which: np.ndarray, ring_of: np.ndarray, pattern: Pattern) -> tuple[np.ndarray, PointRays]:
    """Points on beams ring by ring in the order they were fired, (n, 4) float32, and their beams."""
    share = scan_times(scan.azimuth_rad, scan.time_s, pattern.sweep_s)
    on = np.flatnonzero(which >= 0)
    ring = ring_of[which[on]]
    order = np.lexsort((share[on], ring))
    rows, ring = on[order], ring[order]
    bright = np.zeros(len(rows), np.float32) if scan.intensity is None else scan.intensity[rows]
    points = np.column_stack([scan.xyz[rows], bright]).astype(np.float32)
    nothing = np.zeros(len(rows), np.uint8)
    return points, PointRays(ring.astype(np.uint8), scan.azimuth_rad[rows], share[rows], nothing)


def _finish(twin: RecordingTwin, writer: DriveWriter, head: str) -> None:
    surfels, ground = twin.made.surfels, twin.made.ground
    order = np.argsort(~ground, kind="stable")  # the ground first, as the materials of the mesh come
    parts, reflectance = [], {}
    for material, rows in ((GROUND, order[: int(ground.sum())]), (WALL, order[int(ground.sum()) :])):
        if len(rows):
            vertices, faces = quads(surfels[rows])
            parts.append(Mesh.of(vertices, faces, material))
            reflectance[material] = round(float(np.average(surfels.reflectance[rows], weights=surfels.points[rows])), 4)
    told = any(reflectance.values())
    arrays = {name: np.asarray(getattr(surfels, name)[order]) for name in surfels.__dataclass_fields__}
    flags = {"ground": ground[order].astype(np.uint8), "trusted": twin.made.trusted[order].astype(np.uint8)}
    poses = {"pose": twin.made.poses, "error_m": twin.made.error_m, "on_map": twin.made.on_map}
    held = set(twin.made.held_out)
    lists = {
        "all": twin.names,
        "held_out": [name for number, name in enumerate(twin.names) if number in held],
        "fit": [name for number, name in enumerate(twin.names) if number not in held],
    }
    files = {
        "pattern.yaml": twin.pattern.to_yaml().encode(),
        "twin/static.glb": encode_glb(Mesh.merge(parts), "map"),
        "twin/surfels.npz": npz_bytes({**arrays, **flags}),
        "twin/poses.npz": npz_bytes(poses),
        "twin/materials.yaml": format_materials(MATERIALS, reflectance if told else {}).encode(),
        **{
            f"ImageSets/{name}.txt": "".join(f"{frame}\n" for frame in frames).encode()
            for name, frames in lists.items()
        },
    }
    facts = {key: value for key, value in twin.as_json().items() if key not in ("out", "notes", "held_out")}
    tail = {"sweep_s": twin.pattern.sweep_s, "counts": facts, "notes": list(twin.notes)}
    writer.finish(files, head + yaml.safe_dump(tail, sort_keys=False, allow_unicode=True, width=200))


def _middle(values: np.ndarray) -> float:
    good = values[np.isfinite(values)]
    return float(np.median(good)) if len(good) else float("nan")
