"""A recording on disk as a drive: its scans ring by ring with their poses, and the surfaces of its maps as a twin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from cosim.drives.writer import DriveWriter
from cosim.recordings.mapping.build import BuiltMap
from cosim.recordings.mapping.kept import Kept
from cosim.recordings.mapping.motion import scan_times
from cosim.recordings.mapping.prepare import Prepared
from cosim.recordings.mapping.segments import Segment
from cosim.recordings.mapping.surfels import SurfelSettings, quads
from cosim.recordings.mapping.whole import WholeMap, mapped_segments
from cosim.recordings.pattern.find import beams_of
from cosim.recordings.scan import Scan
from sensors.npz import npz_bytes
from sensors.pattern import Pattern

GROUND, WALL = "asphalt", "concrete"
_CAMERALESS = "A recording has no cameras: there is no calibration here.\n"


@dataclass(frozen=True, eq=False)
class DriveFiles:
    """Writes the drive.

    Attributes:
        prepared: the recording.
        made: its map.
        maps: of the segments.
        names: of its scans as frames, in order.
    """

    prepared: Prepared
    made: WholeMap
    maps: Kept
    names: tuple[str, ...]

    def write(
        self, folder: Path, frames: Sequence[str], fit: Sequence[str], held: Sequence[str], facts: Mapping[str, Any]
    ) -> None:
        """Write what an earlier run has not.

        Args:
            folder: of the drive.
            frames: names of the scans to write; those of segments without a map are left out.
            fit, held: names for the lists of scans that made maps, and that took no part.
            facts: `RecordingTwin.as_json`.
        """
        writer = DriveWriter(folder)
        head = self._head()
        writer.open(head)
        writer.write_once("calib/README.txt", _CAMERALESS.encode())
        reflectance = self._write_worlds(writer)
        self._write_frames(writer, set(frames))
        there = writer.manifest()
        lists = {"all": sorted(there), "held_out": held, "fit": fit}
        poses = {
            "pose": self.made.path,
            "segment": self.made.segment_of.astype(np.int32),
            "world": self.made.world,
            "error_m": self.made.error_m,
            "on_map": self.made.on_map,
        }
        files = {
            "pattern.yaml": self.prepared.pattern.to_yaml().encode(),
            "twin/poses.npz": npz_bytes(poses),
            "twin/materials.yaml": format_materials(MATERIALS, reflectance).encode(),
            **{
                f"ImageSets/{name}.txt": "".join(f"{frame}\n" for frame in subset if frame in there).encode()
                for name, subset in lists.items()
            },
        }
        counts = {key: value for key, value in facts.items() if key not in ("out", "notes", "held_out")}
        tail = {"sweep_s": self.prepared.pattern.sweep_s, "counts": counts, "notes": list(facts["notes"])}
        writer.finish(files, head + yaml.safe_dump(tail, sort_keys=False, allow_unicode=True, width=200))

    def _head(self) -> str:
        recording = self.prepared.recording
        settings = {
            "kind": "measured",
            "source": str(recording.path.resolve()),
            "twin": "map",
            "pattern": self.prepared.pattern.name,
            "scans": len(recording),
            "inferred": recording.schema.as_dict(),
        }
        return yaml.safe_dump(settings | {"cosim": version("cosim")}, sort_keys=False)

    def _world(self, segment: int) -> str | None:
        """Name of a segment's static world; None where there is but one."""
        return None if len(self.made.segments) == 1 else f"segment_{segment:04d}"

    def _write_worlds(self, writer: DriveWriter) -> dict[str, float]:
        """Write the maps as meshes and tables; return the mean reflectance by material, empty if it is unknown."""
        weight: dict[str, float] = dict.fromkeys((GROUND, WALL), 0.0)
        light = dict(weight)
        for segment, made in mapped_segments(self.made, self.maps):
            mesh, table = _world_files(segment, made)
            name = self._world(segment.number)
            writer.write("twin/static.glb" if name is None else f"twin/worlds/{name}.glb", mesh)
            writer.write("twin/surfels.npz" if name is None else f"twin/surfels/{name}.npz", table)
            for material, rows in ((GROUND, made.ground), (WALL, ~made.ground)):
                weight[material] += float(made.surfels.points[rows].sum())
                light[material] += float((made.surfels.points * made.surfels.reflectance)[rows].sum())
        if not any(light.values()):
            return {}
        return {material: round(light[material] / weight[material], 4) for material in weight if weight[material]}

    def _write_frames(self, writer: DriveWriter, wanted: set[str]) -> None:
        recording, made, pattern = self.prepared.recording, self.made, self.prepared.pattern
        done, stamp, held = writer.manifest(), recording.stamp_s, set(made.held_out)
        interval_s = recording.interval_s or pattern.sweep_s
        for number, name in enumerate(self.names):
            if name in done or name not in wanted or not made.mapped[made.segment_of[number]]:
                continue
            time_s = number * interval_s if stamp is None else float(stamp[number] - stamp[0])
            scan = recording[number]
            which = beams_of(scan, self.prepared.found.lasers.lines)
            points, rays = _ordered(scan, which, self.prepared.ring_of, pattern)
            files = {
                f"velodyne/{name}.bin": encode_points(points),
                f"rays/{name}.npz": encode_rays(rays),
                f"twin/frames/{name}.json": self._frame(number, time_s).to_json().encode(),
            }
            off = int((which < 0).sum())
            counts = {"points": len(points), "points_off_beam": off, "held_out": int(number in held)}
            writer.write_frame(name, files, counts)

    def _frame(self, number: int, time_s: float) -> TwinFrame:
        """The frame's poses, and the vehicle's motion from that of the sensor in a sweep."""
        made, sweep_s = self.made, self.prepared.pattern.sweep_s
        segment, motion = int(made.segment_of[number]), made.motion[number]
        pose_ego, lidar = made.pose_ego[segment], made.poses[number]
        ego = lidar @ np.linalg.inv(pose_ego)
        velocity = lidar[:3, :3] @ motion[3:] / sweep_s
        spin = lidar[:3, :3] @ motion[:3] / sweep_s
        velocity = velocity - np.cross(spin, lidar[:3, 3] - ego[:3, 3])  # of the vehicle's origin, below the sensor
        name = self._world(segment)
        return TwinFrame(
            frame=self.names[number],
            time_s=time_s,
            sweep_s=sweep_s,
            ego=Ego(ego, velocity, float(spin[2]), np.zeros(3)),
            lidar=Lidar(pose_ego, self.prepared.pattern.name),
            cameras={},
            instances=(),
            static=None if name is None else f"worlds/{name}.glb",
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


def _world_files(segment: Segment, made: BuiltMap) -> tuple[bytes, bytes]:
    """Mesh and table of a map's surfaces, the ground first."""
    surfels, ground = made.surfels, made.ground
    order, count = np.argsort(~ground, kind="stable"), int(ground.sum())
    parts = []
    for material, rows in ((GROUND, order[:count]), (WALL, order[count:])):
        if len(rows):
            parts.append(Mesh.of(*quads(surfels[rows]), material))
    arrays = {name: np.asarray(getattr(surfels, name)[order]) for name in surfels.__dataclass_fields__}
    flags = {"ground": ground[order].astype(np.uint8), "trusted": made.trusted[order].astype(np.uint8)}
    size = {"cell_m": np.array([SurfelSettings().cell_m])}
    return encode_glb(Mesh.merge(parts), f"map {segment.number}"), npz_bytes({**arrays, **flags, **size})
