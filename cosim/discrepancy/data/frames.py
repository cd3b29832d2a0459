"""The frames of a drive with what a sensor's true beams meet in their twin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.data.ambiguity import Neighbours, widened
from cosim.discrepancy.data.map_surfaces import Maps, MapSurfaces
from cosim.discrepancy.data.observation import Observed, intensity_unit, observe, upwards
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.drives.kitti import Drive, Frame
from cosim.drives.twin import read_trust
from cosim.drives.twin.scene import TwinScenes, ego_motion, lidar_pose, scene_instances
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams, in_order
from sensors.effects.base import Effect
from sensors.motion import EgoMotion
from sensors.rays import Rays
from sensors.scene import Instances
from sensors.sensor_model import SensorModel
from sensors.shot import Shot
from sensors.world import TracerCache, World


@dataclass(frozen=True, eq=False)
class TracedFrame:
    """One frame, measured and traced.

    Attributes:
        name: of the frame.
        place: of its static world, where the drive has several.
        time_s: pose time.
        observed: what was measured, by beam.
        shot: what the model's true beams met, by beam; with its world, so that effects can trace on.
        unsure_m, unsure_intensity: (n,) how far the twin itself may be off where the beam meets it: along the beam and
            in brightness, standard deviations; 0 where it is surveyed.
        edge: (n,) bool: beams whose outcome is ambiguous, because a touch aside the world is another.
        grazed: (n,) bool: those of them that run along what they meet rather than to it.
        nearest_m: (n,) range of the nearest surface at that edge; infinite away from edges.
        neighbours: of the beams.
        border: (n,) bool: beams whose brightness is, because a touch aside the material is another.
        seam: (n,) bool: the same where the other is so much brighter or darker that the brightness tells which it was.
        own_axes: whether its twin was made from its own points, so that its pose cannot be wrong.
        ego, instances: at the pose time.
        map: of the drive's own scans, if the twin is one.
        surface: (n,) int32 row of the map's surface that each beam meets; −1 for none, or no map.
        settings: numbers that decide, of whatever is done with it.
    """

    name: str
    place: str
    time_s: float
    observed: Observed
    shot: Shot
    unsure_m: np.ndarray
    unsure_intensity: np.ndarray
    edge: np.ndarray
    grazed: np.ndarray
    nearest_m: np.ndarray
    neighbours: Neighbours
    border: np.ndarray
    seam: np.ndarray
    own_axes: bool
    ego: EgoMotion
    instances: Instances
    map: MapSurfaces | None
    surface: np.ndarray
    settings: Settings

    @property
    def is_surveyed(self) -> bool:
        """Whether silhouettes stand where the twin has them: neither its own points nor boxes and models tell that."""
        return self.map is None and not self.own_axes

    def unsure(self, shift_m: float, turn_rad: float) -> np.ndarray:
        """(n,) bool: beams that meet something else, or another material, if poses are off by so much."""
        found = self.near_edges(shift_m, turn_rad)
        return found | self.beside_edges(shift_m, turn_rad, ~found)

    def near_edges(self, shift_m: float, turn_rad: float) -> np.ndarray:
        """(n,) bool: of these, beams that stand at an edge between two surfaces then."""
        return widened(self.edge, self.nearest_m, self.shot.pattern, shift_m, turn_rad, self.settings.beams)

    def beside_edges(self, shift_m: float, turn_rad: float, asked: np.ndarray) -> np.ndarray:
        """(n,) bool: of those asked for (n,), beams that then meet another material, or something thin."""
        seam = self.border | self.seam
        apart = np.where(seam, self.shot.hits.solid.range_m, np.inf)
        found = asked & widened(seam, apart, self.shot.pattern, shift_m, turn_rad, self.settings.beams)
        return found | self._beside(shift_m, turn_rad, asked & ~found)

    def _beside(self, shift_m: float, turn_rad: float, asked: np.ndarray) -> np.ndarray:
        """(n,) bool: of those asked for, beams that return from nothing they meet, but from what is a touch aside.

        Wires and thin poles may stand between beams, so that no beam of the twin tells that there is an edge.
        """
        settings = self.settings.beams
        traced, world, measured = self.shot.traced, self.shot.world, self.observed.range_from(self.shot.rays.origin)
        assert traced is not None and world is not None  # frames are traced
        asked = asked & self.observed.returned & self.observed.trusted
        far = asked & ~(np.abs(measured - self.shot.hits.solid.range_m) < settings.same_m)
        rows = np.flatnonzero(far)
        direction, upwards_m = traced.direction[rows], traced.hits.pose[:3, 2]
        across = np.cross(direction, upwards_m)
        upward = np.cross(across, direction)
        angle = turn_rad + shift_m / np.maximum(measured[rows], 1.0)
        turns = np.linspace(0, 2 * np.pi, settings.directions, endpoint=False)
        around = [np.cos(turn) * across + np.sin(turn) * upward for turn in turns]
        shots = np.concatenate([direction + (part * angle)[:, None] * one for part in (0.5, 1.0) for one in around])
        shots /= np.linalg.norm(shots, axis=1, keepdims=True)
        count = 2 * settings.directions
        time_s = np.broadcast_to(traced.time_s, len(measured))[rows]
        origin = np.tile(traced.origin[rows], (count, 1))
        met = world.shoot(origin, shots, np.tile(time_s, count), self.shot.pattern.range_m[1])
        same = np.abs(met.range_m - np.tile(measured[rows], count)) < settings.same_m
        found = np.zeros(len(measured), bool)
        found[rows] = same.reshape(count, len(rows)).any(0)
        return found


class FrameTracer:
    """Traces the frames of a drive with a sensor's beam effects.

    Args:
        drive: with points and a twin.
        sensor: its pattern is what points are sorted onto.
        settings: numbers that decide.

    Raises:
        DriveError: intensities are neither 0–1 nor bytes.
    """

    def __init__(self, drive: Drive, sensor: SensorModel, settings: Settings = DEFAULT) -> None:
        self.drive, self.sensor, self.settings = drive, sensor, settings
        self._scenes = TwinScenes(drive)
        self._unit = intensity_unit(drive, settings.beams)
        self._rays: Rays = sensor.pattern.rays()
        self._neighbours = Neighbours(self._rays, settings.beams)
        self._tracers = TracerCache(sensor.pattern.range_m)
        self._maps = Maps(drive, settings.sampling)
        self._excluded: frozenset[int] = frozenset()

    def exclude_rings(self, rings: Sequence[int]) -> None:
        """Beams of these rings are not compared in frames that are traced from now on."""
        self._excluded = self._excluded | frozenset(rings)

    def trace(self, name: str, effects: tuple[Effect, ...]) -> TracedFrame:
        """One frame, as beams changed by `effects` meet it."""
        frame = self.drive[name]
        twin = frame.twin
        instances, ego, pattern = scene_instances(twin.instances), ego_motion(twin), self.sensor.pattern
        world = World(self._scenes.of(frame), lidar_pose(twin), instances, ego, pattern.range_m, self._tracers)
        observed = observe(frame, pattern, self._rays, self._unit, self.settings.beams)
        before = Shot(pattern, observed.rays, world=world, frame_time_s=twin.time_s)
        streams = Streams(np.random.default_rng(0))
        beams = act_on_beams(in_order(effects), Beams.nominal(observed.rays), before, streams, self.sensor.origin)
        traced = world.trace(beams)
        shot = Shot(pattern, beams.rays, beams=beams, traced=traced, world=world, frame_time_s=twin.time_s)
        surface, own_map = np.full(len(observed.rays), -1, np.int32), self._maps.of(twin.static)
        if own_map is None:
            trusted, unsure_m, unsure_intensity = _known(frame, shot, observed, self.settings.beams.grazing)
        else:
            surface, trusted, unsure_m = _on_map(own_map, shot, observed, ego, self.settings.beams.grazing)
            unsure_intensity = np.zeros(len(observed.rays), np.float32)
        trusted = trusted & ~np.isin(observed.rays.ring, list(self._excluded))
        border, seam = self._neighbours.at_border(traced.hits)
        edge, grazed, nearest_m = self._neighbours.at_edge(traced.hits)
        return TracedFrame(
            name=name,
            place=twin.static or "",
            time_s=twin.time_s,
            observed=replace(observed, trusted=trusted),
            shot=shot,
            unsure_m=unsure_m,
            unsure_intensity=unsure_intensity,
            edge=edge,
            grazed=grazed,
            nearest_m=nearest_m,
            neighbours=self._neighbours,
            border=border,
            seam=seam,
            own_axes=frame.has("twin/trust"),
            ego=ego,
            instances=instances,
            map=own_map,
            surface=surface,
            settings=self.settings,
        )

    def trace_all(self, names: Sequence[str], effects: tuple[Effect, ...]) -> list[TracedFrame]:
        """Several frames."""
        return [self.trace(name, effects) for name in names]


def _known(frame: Frame, shot: Shot, observed: Observed, grazing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which beams may be compared, all or those that a twin made from labels tells something of; how unsure it is."""
    if not frame.has("twin/trust"):
        sure = np.zeros(len(observed.rays), np.float32)
        return observed.trusted, sure, sure
    trust = read_trust(frame.path("twin/trust"))
    solid, traced = shot.hits.solid, shot.traced
    assert traced is not None  # frames are traced
    met, measured = _places(shot, observed)
    found = trust.beams(frame.twin.instances, met, solid.instance, measured)
    away, bright = trust.unsure(met, solid.instance)
    steep = np.abs(np.einsum("ij,ij->i", solid.normal, traced.direction))
    trusted = found & (trust.ground_range | (solid.instance >= 0))
    return trusted, away / np.maximum(steep, grazing), bright


def _on_map(
    surfaces: MapSurfaces, shot: Shot, observed: Observed, ego: EgoMotion, grazing: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Surfaces of a map that beams meet, which beams may be compared, and how unsure roughness makes ranges."""
    solid, traced = shot.hits.solid, shot.traced
    assert traced is not None  # frames are traced
    place = _places(shot, observed)[0]
    surface = surfaces.met(place, solid.instance).astype(np.int32)
    slope = np.abs(np.einsum("ij,ij->i", solid.normal, traced.direction))
    returned = traced.origin + traced.direction * observed.along_m[:, None]
    turning = np.cross([0.0, 0.0, ego.yaw_rate_radps], returned - ego.pose[:3, 3])
    moved = (observed.rays.time_s - traced.time_s)[:, None] * (ego.velocity_mps + turning)
    trusted = observed.trusted & surfaces.compared(surface, place, slope, returned, moved)
    return surface, trusted, surfaces.unsure_m(surface, slope, grazing)


def _places(shot: Shot, observed: Observed) -> tuple[np.ndarray, np.ndarray]:
    """World places (n, 3) of the traced hits and of the measured returns; NaN where there are none."""
    solid, traced = shot.hits.solid, shot.traced
    assert traced is not None  # frames are traced
    met = traced.origin + traced.direction * np.where(solid.exists, solid.range_m, np.nan)[:, None]
    pose, direction = shot.hits.pose, observed.rays.direction
    point = observed.along_m[:, None] * direction + observed.above_m[:, None] * upwards(direction)
    return met, point @ pose[:3, :3].T + pose[:3, 3]
