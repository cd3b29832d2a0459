"""Summary of the maps of all segments for pages and JSON; its size does not depend on the recording's length."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.recordings.mapping.build import BuiltMap, NoMapError
from cosim.recordings.mapping.kept import Kept, map_of
from cosim.recordings.mapping.motion import applied
from cosim.recordings.mapping.odometry import Trajectory
from cosim.recordings.mapping.segments import Segment, chained


@dataclass(frozen=True, eq=False)
class WholeMap:
    """m surfaces in the axes of the first map, and n scans.

    Attributes:
        segments: of the scans.
        mapped: (k,) bool, which segments have a map.
        refused: of the others, why, a line each.
        world: (k, 4, 4) of each segment in the axes of the first.
        centre: (m, 3) float32 positions of surfaces [m].
        sd_m: (m,) float32 their thickness.
        scans: (m,) int32 how many saw each.
        level, ground, trusted: (m,) bool.
        left_out: (o, 3) float32 positions of moving surfaces.
        poses: (n, 4, 4) of the sensor, each in its own segment's world.
        motion: (n, 6) of the sensor in a sweep.
        segment_of: (n,) segment of each scan.
        pose_ego: (k, 4, 4) of the sensor on the vehicle.
        mount_known: whether height and tilt come from the ground or the settings.
        held_out: numbers of scans that took no part.
        error_m, on_map, held: (n,) as of `BuiltMap`.
        no_plane: cells with points enough that are no plane.
        rounds: (r, 2) thickness of ground and of walls [m] after each round, usual of all segments.
    """

    segments: tuple[Segment, ...]
    mapped: np.ndarray
    refused: tuple[str, ...]
    world: np.ndarray
    centre: np.ndarray
    sd_m: np.ndarray
    scans: np.ndarray
    level: np.ndarray
    ground: np.ndarray
    trusted: np.ndarray
    left_out: np.ndarray
    poses: np.ndarray
    motion: np.ndarray
    segment_of: np.ndarray
    pose_ego: np.ndarray
    mount_known: bool
    held_out: tuple[int, ...]
    error_m: np.ndarray
    on_map: np.ndarray
    held: np.ndarray
    no_plane: int
    rounds: np.ndarray

    def __len__(self) -> int:
        return len(self.centre)

    @property
    def path(self) -> np.ndarray:
        """Poses (n, 4, 4) of the sensor in the axes of the first map."""
        return self.world[self.segment_of] @ self.poses

    @property
    def fitted(self) -> tuple[int, ...]:
        """Numbers of the scans that made maps."""
        held = set(self.held_out)
        return tuple(
            number for number, segment in enumerate(self.segment_of) if self.mapped[segment] and number not in held
        )


def whole_map(segments: Sequence[Segment], paths: Sequence[Trajectory], kept: Kept) -> WholeMap:
    """The maps of segments seen as one; each is read once, and let go.

    Raises:
        NoMapError: no segment has a map.
    """
    parts, refused = [], []
    for segment, path in zip(segments, paths, strict=True):
        try:
            parts.append(_part(segment, map_of(kept.read(segment))))
        except NoMapError as error:
            refused.append(str(error))
            parts.append(_mapless(segment, path))
    mapped = np.array([part["mapped"] for part in parts])
    if not mapped.any():
        raise NoMapError(refused[0])
    world = chained(segments, [part["all_poses"] for part in parts])
    moved = {
        name: np.concatenate([applied(own, part[name]) for own, part in zip(world, parts, strict=True)])
        for name in ("centre", "left_out")
    }
    joined = {name: np.concatenate([part[name] for part in parts]) for name in _JOINED}
    rounds = [part["rounds"] for part in parts if part["mapped"]]
    return WholeMap(
        segments=tuple(segments),
        mapped=mapped,
        refused=tuple(refused),
        world=world,
        **{name: values.astype(np.float32) for name, values in moved.items()},
        **joined,
        segment_of=np.repeat(np.arange(len(segments)), [segment.end - segment.begin for segment in segments]),
        pose_ego=np.array([part["pose_ego"] for part in parts]),
        mount_known=all(part["mount_known"] for part in parts),
        held_out=tuple(int(number) for part in parts for number in part["held_out"]),
        no_plane=sum(part["no_plane"] for part in parts),
        rounds=np.median(np.array(rounds), axis=0),
    )


_JOINED = ("sd_m", "scans", "level", "ground", "trusted", "poses", "motion", "error_m", "on_map", "held")


def mapped_segments(whole: WholeMap, kept: Kept) -> Iterator[tuple[Segment, BuiltMap]]:
    """The segments that have a map, one after the other."""
    for segment in whole.segments:
        if whole.mapped[segment.number]:
            yield segment, map_of(kept.read(segment))


def _part(segment: Segment, made: BuiltMap) -> dict:
    own, surfels = segment.own, made.surfels
    numbers = [segment.first + number for number in made.held_out]
    return {
        "mapped": True,
        "all_poses": made.poses,
        "centre": surfels.centre,
        "sd_m": surfels.sd_m.astype(np.float32),
        "scans": surfels.scans.astype(np.int32),
        "level": surfels.level(),
        "ground": made.ground,
        "trusted": made.trusted,
        "left_out": made.left_out.centre,
        "poses": made.poses[own],
        "motion": made.motion[own],
        "pose_ego": made.pose_ego,
        "mount_known": made.mount_known,
        "held_out": [number for number in numbers if segment.begin <= number < segment.end],
        "error_m": made.error_m[own],
        "on_map": made.on_map[own],
        "held": made.held[own],
        "no_plane": made.no_plane,
        "rounds": made.rounds,
    }


def _mapless(segment: Segment, path: Trajectory) -> dict:
    own, nothing = segment.own, np.zeros(0)
    count = segment.end - segment.begin
    return {
        "mapped": False,
        "all_poses": path.poses,
        **dict.fromkeys(("centre", "left_out"), np.zeros((0, 3))),
        "sd_m": nothing.astype(np.float32),
        "scans": nothing.astype(np.int32),
        **dict.fromkeys(("level", "ground", "trusted"), nothing.astype(bool)),
        "poses": path.poses[own],
        "motion": path.motion[own],
        "pose_ego": np.eye(4),
        "mount_known": True,
        "held_out": [],
        "error_m": np.full(count, np.nan),
        "on_map": np.zeros(count),
        "held": np.zeros(count),
        "no_plane": 0,
        "rounds": (),
    }
