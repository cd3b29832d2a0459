"""Ray casting of a drive's frames: the measured beams together with the surfaces that the model's beams hit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosim.discrepancy.data.ambiguity import Neighbours, widened
from cosim.discrepancy.data.map_surfaces import Maps, MapSurfaces
from cosim.discrepancy.data.observation import Observed, intensity_unit, observe, upwards
from cosim.discrepancy.data.reflectances import FrameReflectances, Reflectances
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.drives.kitti import Drive, Frame
from cosim.drives.twin import read_trust
from cosim.drives.twin.scene import TwinScenes, ego_motion, lidar_pose, scene_instances
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams, in_order
from sensors.effects.base import Effect
from sensors.hits import Hits
from sensors.motion import EgoMotion
from sensors.rays import Rays
from sensors.scene import Instances
from sensors.sensor_model import SensorModel
from sensors.shot import Shot
from sensors.world import TracerCache, World

_CELL_PRIOR = 10.0  # beams' worth of the scan's share of unmapped returns in each cell


@dataclass(frozen=True, eq=False)
class TracedFrame:
    """One frame: measurements and traced beams.

    Attributes:
        name: name of the frame.
        place: name of its static world if the drive has several.
        time_s: pose time [s].
        observed: measurements by beam.
        shot: hits of the model's true beams; with its world, so that effects can trace further rays.
        twin_sigma_m, twin_sigma_intensity: (n,) σ of the twin itself at the hit: along the beam [m] and in intensity; 0
            for surveyed twins.
        edge: (n,) bool ambiguous beams: a slightly different beam would hit another surface.
        grazed: (n,) bool those of them that are nearly parallel to the surface.
        nearest_m: (n,) range [m] of the nearest surface at the edge; infinite away from edges.
        neighbours: neighbour table of the beams.
        border: (n,) bool beams with ambiguous intensity: a slightly different beam would hit another material.
        seam: (n,) bool the same if the reflectances differ so much that the measured intensity shows which was hit.
        own_axes: whether the twin was made from the frame's own points, so that its pose has no error.
        ego, instances: motion of the vehicle, and objects, at the pose time.
        map: map made from the drive's scans, if the twin is one; else None.
        surface: (n,) int32 row of the map surface that each beam hits; −1 for none or without a map.
        at_end: (n,) bool beams near the end of a map, beyond which they hit nothing; none without a map.
        unmapped: (n,) share of the beams towards a map's surfaces there that something stops that is not in the map.
        settings: settings of the loop.
    """

    name: str
    place: str
    time_s: float
    observed: Observed
    shot: Shot
    twin_sigma_m: np.ndarray
    twin_sigma_intensity: np.ndarray
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
    at_end: np.ndarray
    unmapped: np.ndarray
    settings: Settings

    @property
    def is_surveyed(self) -> bool:
        """Whether the twin has accurate silhouettes and texture: not if it was made from its points or from boxes."""
        return self.map is None and not self.own_axes

    def near_uncertain_edges(self, shift_m: float, turn_rad: float) -> np.ndarray:
        """(n,) bool beams that may hit another surface or material for pose errors of this size [m, rad]."""
        at_edge = self.near_edges(shift_m, turn_rad)
        return at_edge | self.near_other_materials(shift_m, turn_rad, ~at_edge)

    def near_edges(self, shift_m: float, turn_rad: float) -> np.ndarray:
        """(n,) bool those of them that may hit another surface beyond an edge."""
        return widened(self.edge, self.nearest_m, self.shot.pattern, shift_m, turn_rad, self.settings.beams)

    def near_other_materials(self, shift_m: float, turn_rad: float, requested: np.ndarray) -> np.ndarray:
        """(n,) bool beams among `requested` (n,) that may hit another material, or a thin object between beams."""
        seam = self.border | self.seam
        range_m = np.where(seam, self.shot.hits.solid.range_m, np.inf)
        is_near = requested & widened(seam, range_m, self.shot.pattern, shift_m, turn_rad, self.settings.beams)
        comparable = requested & ~is_near & self.observed.returned & self.observed.trusted
        measured = self.observed.range_from(self.shot.rays.origin)
        return is_near | self.fits_nearby(np.where(comparable, measured, np.nan), shift_m, turn_rad)

    def has_surface_nearby(self, beams: np.ndarray, range_m: np.ndarray) -> np.ndarray:
        """(k,) bool beams (k,) near which a traced beam, at most a few rings and firings away, has this range (k,) [m].

        False where the range is NaN.
        """
        pattern, settings = self.shot.pattern, self.settings.beams
        traced_m = self.shot.hits.solid.range_m.reshape(pattern.rings, pattern.firings).astype(float)
        traced_m = np.where(np.isfinite(traced_m), traced_m, -np.inf)
        ring, firing = beams // pattern.firings, beams % pattern.firings
        found = np.zeros(len(beams), bool)
        for down in range(-settings.nearby_rings, settings.nearby_rings + 1):
            for along in range(-settings.nearby_firings, settings.nearby_firings + 1):
                other_m = traced_m[np.clip(ring + down, 0, pattern.rings - 1), (firing + along) % pattern.firings]
                found |= np.abs(other_m - range_m) < settings.nearby_m + settings.jump_share * range_m
        return found

    def fits_nearby(self, range_m: np.ndarray, shift_m: float, turn_rad: float) -> np.ndarray:
        """(n,) bool beams of which a range (n,) [m] fits not their own hit but that of a nearby direction.

        Wires and thin poles may lie between beams, so that no traced beam shows the edge. False where it is NaN.
        """
        settings = self.settings.beams
        traced, world = self.shot.traced, self.shot.world
        assert traced is not None and world is not None  # frames are traced
        rows = np.flatnonzero(np.isfinite(range_m))
        rows = rows[~(np.abs(range_m[rows] - self.shot.hits.solid.range_m[rows]) < settings.same_m)]
        direction, upwards_m = traced.direction[rows], traced.hits.pose[:3, 2]
        across = np.cross(direction, upwards_m)
        upward = np.cross(across, direction)
        angle = turn_rad + shift_m / np.maximum(range_m[rows], 1.0)
        angles = np.linspace(0, 2 * np.pi, settings.directions, endpoint=False)
        offsets = [np.cos(turn) * across + np.sin(turn) * upward for turn in angles]
        parts = np.arange(1, settings.distances + 1) / settings.distances
        shots = np.concatenate([direction + (part * angle)[:, None] * offset for part in parts for offset in offsets])
        shots /= np.linalg.norm(shots, axis=1, keepdims=True)
        count = len(parts) * len(offsets)
        time_s = np.broadcast_to(traced.time_s, len(range_m))[rows]
        origin = np.tile(traced.origin[rows], (count, 1))
        hits = world.shoot(origin, shots, np.tile(time_s, count), self.shot.pattern.range_m[1])
        same = np.abs(hits.range_m - np.tile(range_m[rows], count)) < settings.same_m
        is_beside = np.zeros(len(range_m), bool)
        is_beside[rows] = same.reshape(count, len(rows)).any(0)
        return is_beside


class FrameTracer:
    """Traces the frames of a drive with a sensor's beam effects.

    Args:
        drive: drive with points and a twin.
        sensor: sensor model; points are assigned to the beams of its pattern.
        settings: settings of the loop.

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
        self._reflectances: Reflectances | None = None

    def exclude_rings(self, rings: Sequence[int]) -> None:
        """Exclude the beams of these rings from comparison in frames traced afterwards."""
        self._excluded = self._excluded | frozenset(rings)

    def use_reflectances(self, reflectances: Reflectances) -> None:
        """Use these reflectances in frames traced afterwards."""
        self._reflectances = reflectances
        self._scenes = TwinScenes(self.drive, table=reflectances.table)

    def trace(self, name: str, effects: tuple[Effect, ...]) -> TracedFrame:
        """Trace one frame with beams deflected by `effects`."""
        frame = self.drive[name]
        twin, solved = frame.twin, self._reflectances.by_frame.get(name) if self._reflectances else None
        instances, ego, pattern = scene_instances(twin.instances), ego_motion(twin), self.sensor.pattern
        if solved is not None:
            instances = replace(instances, paint=solved.paint)
        world = World(self._scenes.of(frame), lidar_pose(twin), instances, ego, pattern.range_m, self._tracers)
        observed = observe(frame, pattern, self._rays, self._unit, self.settings.beams)
        before = Shot(pattern, observed.rays, world=world, frame_time_s=twin.time_s)
        streams = Streams(np.random.default_rng(0))
        beams = act_on_beams(in_order(effects), Beams.nominal(observed.rays), before, streams, self.sensor.origin)
        traced = world.trace(beams)
        shot = Shot(pattern, beams.rays, beams=beams, traced=traced, world=world, frame_time_s=twin.time_s)
        surface, own_map, stopped = np.full(len(observed.rays), -1, np.int32), self._maps.of(twin.static), None
        if own_map is None:
            trusted, twin_sigma_m, twin_sigma_intensity = _read_trust(
                frame, shot, observed, self.settings.beams.grazing, solved
            )
        else:
            surface, trusted, twin_sigma_m, stopped = _on_map(own_map, shot, observed, ego, self.settings.beams.grazing)
            twin_sigma_intensity = np.zeros(len(observed.rays), np.float32)
            solid = replace(traced.hits.solid, measured=own_map.reflectances(surface))
            traced = replace(traced, hits=replace(traced.hits, solid=solid))
            shot = Shot(pattern, beams.rays, beams=beams, traced=traced, world=world, frame_time_s=twin.time_s)
        trusted = trusted & ~np.isin(observed.rays.ring, list(self._excluded))
        border, seam = self._neighbours.at_border(traced.hits)
        edge, grazed, nearest_m = self._neighbours.at_edge(traced.hits)
        made = TracedFrame(
            name=name,
            place=twin.static or "",
            time_s=twin.time_s,
            observed=replace(observed, trusted=trusted),
            shot=shot,
            twin_sigma_m=twin_sigma_m,
            twin_sigma_intensity=twin_sigma_intensity,
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
            at_end=np.zeros(len(edge), bool) if own_map is None else self._at_end(traced.hits, own_map.cell_m),
            unmapped=np.broadcast_to(0.0, len(edge))
            if stopped is None
            else self._unmapped(shot, observed, stopped, trusted, ~edge),
            settings=self.settings,
        )
        shot.is_texture_known = made.is_surveyed
        return made

    def _unmapped(
        self, shot: Shot, observed: Observed, stopped: np.ndarray, trusted: np.ndarray, among: np.ndarray
    ) -> np.ndarray:
        """Share (n,) of beams that something unmapped stops, by cell of the static world of what they should hit.

        Shares of cells with few beams are drawn towards that of the scan, which beams without a hit get.

        Args:
            shot, observed: beams of a scan as traced and as measured.
            stopped: (n,) mask of beams that return from something unmapped.
            trusted: (n,) mask of those that can be compared.
            among: (n,) mask of the beams that count.
        """
        stopped, counted = stopped & among, (stopped | (trusted & observed.returned)) & among
        usual = float(stopped.sum() / max(np.count_nonzero(counted), 1))
        met, _ = _world_points(shot, observed)
        has_hit = np.isfinite(met[:, 0])
        places = np.floor(met[has_hit, :2] / self.settings.sampling.cell_m).astype(int)
        _, cell = np.unique(places, axis=0, return_inverse=True)
        counts = [np.bincount(cell.ravel(), values[has_hit]) for values in (stopped, counted)]
        shares = np.full(len(stopped), usual)
        shares[has_hit] = ((counts[0] + _CELL_PRIOR * usual) / (counts[1] + _CELL_PRIOR))[cell.ravel()]
        return shares

    def _at_end(self, hits: Hits, cell_m: float) -> np.ndarray:
        """(n,) bool beams within a cell of the end of a map."""
        at_end = self._neighbours.next_to_sky(hits)
        nearest_m = np.where(at_end, hits.solid.range_m, np.inf)
        return widened(at_end, nearest_m, self.sensor.pattern, cell_m, 0.0, self.settings.beams)

    def trace_all(self, names: Sequence[str], effects: tuple[Effect, ...]) -> list[TracedFrame]:
        """Trace several frames."""
        return [self.trace(name, effects) for name in names]


def _read_trust(
    frame: Frame, shot: Shot, observed: Observed, grazing: float, solved: FrameReflectances | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mask (n,) of comparable beams and σ (n,) of ranges [m] and intensities, from `twin/trust` if present."""
    if not frame.has("twin/trust"):
        zeros = np.zeros(len(observed.rays), np.float32)
        return observed.trusted, zeros, zeros
    trust = read_trust(frame.path("twin/trust"))
    if solved is not None:
        spreads = {"ground_intensity_sd": solved.ground_intensity_sd, "body_intensity_sd": solved.body_intensity_sd}
        trust = replace(trust, **spreads)
    solid, traced = shot.hits.solid, shot.traced
    assert traced is not None  # frames are traced
    met, measured = _world_points(shot, observed)
    is_trusted = trust.beams(frame.twin.instances, met, solid.instance, measured)
    sigma_m, sigma_intensity = trust.sigmas(met, solid.instance)
    steep = np.abs(np.einsum("ij,ij->i", solid.normal, traced.direction))
    trusted = is_trusted & (trust.ground_range | (solid.instance >= 0))
    return trusted, sigma_m / np.maximum(steep, grazing), sigma_intensity


def _on_map(
    surfaces: MapSurfaces, shot: Shot, observed: Observed, ego: EgoMotion, grazing: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Surfaces of the map that beams hit, and how they can be compared.

    Returns:
        Surfaces (n,), mask (n,) of comparable beams, σ (n,) of ranges due to roughness [m], and mask (n,) of beams
        towards them that return from something else.
    """
    solid, traced = shot.hits.solid, shot.traced
    assert traced is not None  # frames are traced
    position = _world_points(shot, observed)[0]
    surface = surfaces.met(position, solid.instance).astype(np.int32)
    slope = np.abs(np.einsum("ij,ij->i", solid.normal, traced.direction))
    returned = traced.origin + traced.direction * observed.along_m[:, None]
    turning = np.cross([0.0, 0.0, ego.yaw_rate_radps], returned - ego.pose[:3, 3])
    moved = (observed.rays.time_s - traced.time_s)[:, None] * (ego.velocity_mps + turning)
    compared, stopped = surfaces.compared(surface, position, slope, returned, moved)
    return surface, observed.trusted & compared, surfaces.twin_sigma_m(surface, slope, grazing), stopped


def _world_points(shot: Shot, observed: Observed) -> tuple[np.ndarray, np.ndarray]:
    """World points (n, 3) [m] of the traced hits and of the measured returns; NaN for none."""
    solid, traced = shot.hits.solid, shot.traced
    assert traced is not None  # frames are traced
    met = traced.origin + traced.direction * np.where(solid.exists, solid.range_m, np.nan)[:, None]
    pose, direction = shot.hits.pose, observed.rays.direction
    point = observed.along_m[:, None] * direction + observed.above_m[:, None] * upwards(direction)
    return met, point @ pose[:3, :3].T + pose[:3, 3]
