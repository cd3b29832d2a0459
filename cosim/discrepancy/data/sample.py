"""A sample of beams of a whole drive, with what was measured of them and what else they have in common."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.forward.replay import FrameReplay
from cosim.discrepancy.inference.clusters import Clusters, nearness
from sensors.effects.base import Effect
from sensors.hits import NOTHING, STATIC

CELL_M, _OFF_CELL_M = 5.0, 20.0  # of maps that are exact, and of those whose errors reach far
_MATCHED_M = 1.0
_FEWEST_PARTS = 120
_SKY_RAD = 0.1
_ODD_SHARE = 0.3  # of the sample at most, for beams that return from where nothing is
_RARE_SHARE = 0.2  # of the sample
_LONE_SHARE = 0.25  # of the sample, for returns that tell of the sensor alone


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a model expects of the n beams of a sample, in the terms of what was measured.

    Attributes:
        range_m, range_sigma_m: mean and spread of the component along the beam; NaN where no surface can answer.
        rise_m: the component across it, upwards.
        intensity, intensity_sigma: mean and spread.
        seen: probability that the surface's return is reported.
        silent: probability that nothing is.
        stray: (n,) density [1/m] of returns from elsewhere at the measured range; 0 where nothing was measured.
        unsure_m, unsure_intensity: how far the twin itself may be off, standard deviations beside those of the sensor.
        shared_m: the part of `unsure_m` that beams beside each other share.
    """

    range_m: np.ndarray
    range_sigma_m: np.ndarray
    rise_m: np.ndarray
    intensity: np.ndarray
    intensity_sigma: np.ndarray
    seen: np.ndarray
    silent: np.ndarray
    stray: np.ndarray
    unsure_m: np.ndarray
    unsure_intensity: np.ndarray
    shared_m: np.ndarray


@dataclass(frozen=True, eq=False)
class Sample:
    """n beams of some frames.

    Attributes:
        replays: one a frame, of its beams.
        frame: (n,) int row of `names`.
        beam: (n,) int row of the frame's beams.
        names: of the frames, in order of time.
        weight: (n,) how many beams each stands for.
        along_m, above_m, intensity: (n,) measured, as in `Observed`; NaN where nothing returned.
        track: (n,) int what beams share errors with over time: an instance, or a cell of the map.
        cells: (tracks, 3) number of the world and middle [m] of each cell of a map; NaN of other tracks.
        pose_derivative: (n, 6) change of range per metre and radian of the LiDAR's pose, in its own axes.
        unsure_m, unsure_intensity: (n,) how far the twin itself may be off, see `TracedFrame`.
        shared_m: (n,) the part of `unsure_m` that comes of its scatter, which beams beside each other share.
        edge: (n,) bool ambiguous beams.
        border: (n,) bool beams of ambiguous brightness.
        seam: (n,) bool the same, where the brightness itself tells whose it is.
        compared: (n,) bool: beams that can be compared with the twin; of others it only tells something where their
            returns stand above them.
        partner: (n,) int row of the beam fired just before or after at the same surface, −1 where there is none:
            their difference knows nothing of errors that both share.
        ring, material, instance: (n,) int.
        reflectance, previous_intensity: (n,) of the surface; measured of the beam fired before in the ring, 0 for none.
        leaning: (scans, 6) pose errors that were traced with, see `TracedFrame`.
        own_axes: whether scans stand where their twins were made, so that poses have no errors.
        scan_values: by name, (scans,) pose time, and the ego vehicle's speed, acceleration and yaw rate.
        azimuth, time_s, range_m, cos_incidence: (n,) of the beams as traced.
    """

    replays: tuple[FrameReplay, ...]
    frame: np.ndarray
    beam: np.ndarray
    names: tuple[str, ...]
    weight: np.ndarray
    along_m: np.ndarray
    above_m: np.ndarray
    intensity: np.ndarray
    track: np.ndarray
    cells: np.ndarray
    pose_derivative: np.ndarray
    unsure_m: np.ndarray
    unsure_intensity: np.ndarray
    shared_m: np.ndarray
    edge: np.ndarray
    border: np.ndarray
    seam: np.ndarray
    compared: np.ndarray
    partner: np.ndarray
    ring: np.ndarray
    azimuth: np.ndarray
    time_s: np.ndarray
    range_m: np.ndarray
    cos_incidence: np.ndarray
    material: np.ndarray
    instance: np.ndarray
    place: np.ndarray
    reflectance: np.ndarray
    previous_intensity: np.ndarray
    leaning: np.ndarray
    own_axes: bool
    scan_values: dict[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.frame)

    @cached_property
    def share(self) -> np.ndarray:
        """(n,) weights that are 1 on average."""
        return self.weight / self.weight.mean()

    @cached_property
    def returned(self) -> np.ndarray:
        """(n,) bool."""
        return ~np.isnan(self.along_m)

    @cached_property
    def map_is_off(self) -> bool:
        """Whether spots of the map are known to stand off, each by its own error."""
        return bool(np.any(self.shared_m[self.instance == STATIC] > 0))

    @cached_property
    def map_is_unsure(self) -> bool:
        """Whether the twin is not sure of its map, or that is known to be off."""
        return bool(np.any(self.unsure_m[self.instance == STATIC] > 0))

    @cached_property
    def has_intensity(self) -> bool:
        """Whether the drive has intensities at all."""
        return bool(np.nanmax(np.append(self.intensity, 0.0)) > 0)

    @cached_property
    def intensity_limits(self) -> tuple[float, float]:
        """Values at or beyond which intensities have been cut off.

        Stored in steps, whatever is more than half a step above the last value but one has become the last.
        """
        told = self.intensity[~np.isnan(self.intensity)]
        inside = told[(told > 0) & (told < 1)]
        low = float(inside.min()) / 2 if len(inside) and (told <= 0).any() else 0.0
        high = (1 + float(inside.max())) / 2 if len(inside) and (told >= 1).any() else 1.0
        return low, high

    @cached_property
    def clusters(self) -> Clusters:
        """What its beams share errors with; parts are equal sectors of scans, as many as it takes to have enough."""
        sectors = -(-_FEWEST_PARTS // max(len(self.names), 1))
        part = self.frame * sectors + ((self.azimuth + np.pi) / (2 * np.pi) * sectors).astype(int) % sectors
        return Clusters(self.track, self.frame, part, nearness(self.cells))

    def reported_range(self, effects: Sequence[Effect]) -> np.ndarray:
        """(n,) measured ranges from where effects have the optical centre stand [m]; NaN where nothing returned."""
        found = [replay.ranges(effects, self.along_m[rows], self.above_m[rows]) for replay, rows in self._frames()]
        return np.concatenate(found)

    def moved(self, effects: Sequence[Effect]) -> tuple[float, float]:
        """How far effects turn [rad] and shift [m] beams from where they were traced, at most."""
        found = [replay.moved(effects) for replay in self.replays]
        return max(turn for turn, _ in found), max(shift for _, shift in found)

    def predict(self, effects: Sequence[Effect]) -> Prediction:
        """What effects let expect of the sample's beams."""
        effects = tuple(sorted(effects, key=lambda effect: effect.phase))
        parts = [_predict(replay, effects, self.along_m[rows]) for replay, rows in self._frames()]
        columns = [np.concatenate(column) for column in zip(*parts, strict=True)]
        return Prediction(*[*columns, self.unsure_m, self.unsure_intensity, self.shared_m])

    def _frames(self) -> Iterator[tuple[FrameReplay, np.ndarray]]:
        for number, replay in enumerate(self.replays):
            yield replay, self.frame == number


def _predict(replay: FrameReplay, effects: tuple[Effect, ...], measured_m: np.ndarray) -> tuple[np.ndarray, ...]:
    found, along, above = replay.expect(effects)
    shot = replay.shot(effects)
    stray = np.zeros(len(measured_m))
    rows = np.flatnonzero(~np.isnan(measured_m))
    for effect in effects:
        if type(effect).density is not Effect.density:
            stray[rows] += effect.density(rows, measured_m[rows] - along[rows], shot)
    return (
        found.range_m + along,
        found.range_sigma_m,
        above,
        found.intensity,
        found.intensity_sigma,
        found.seen,
        found.silent,
        stray,
    )


def draw_sample(frames: Sequence[TracedFrame], count: int, rng: np.random.Generator, *, edges: bool = False) -> Sample:
    """A sample of about `count` beams in neighbouring pairs: of every frame alike, more of objects than of the rest.

    Materials that few beams meet, as those of plates and signs, are taken nearly whole.


    Args:
        frames: in order of time.
        count: how many beams to take, roughly.
        rng: for the draw.
        edges: whether ambiguous beams take part.
    """
    share = max(count // max(len(frames), 1), 1)
    return _gathered(frames, [_choose(frame, share, rng, edges) for frame in frames])


def same_beams(sample: Sample, frames: Sequence[TracedFrame]) -> Sample:
    """The beams of a sample in frames that have been traced anew."""
    ends = np.searchsorted(sample.frame, np.arange(len(frames) + 1))
    chosen = []
    for start, end in pairwise(ends.tolist()):
        partner = sample.partner[start:end]
        mine = np.where(partner >= 0, partner - start, -1)
        chosen.append((sample.beam[start:end], sample.weight[start:end], mine))
    return _gathered(frames, chosen)


def _gathered(frames: Sequence[TracedFrame], chosen: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Sample:
    replays, columns, rows = [], [], 0
    for number, (frame, (beams, weight, partner)) in enumerate(zip(frames, chosen, strict=True)):
        replays.append(FrameReplay(frame, beams))
        partner = np.where(partner >= 0, partner + rows, -1)
        columns.append(
            {"frame": np.full(len(beams), number), "beam": beams, "weight": weight, "partner": partner}
            | _columns(frame, beams)
        )
        rows += len(beams)
    joined = {name: np.concatenate([one[name] for one in columns]) for name in columns[0]}
    track, cells = _tracks(frames, joined["frame"], joined["instance"], joined["place"], joined["azimuth"])
    return Sample(
        replays=tuple(replays),
        names=tuple(one.name for one in frames),
        previous_intensity=np.concatenate([replay.previous_intensity for replay in replays]).astype(np.float64),
        track=track,
        cells=cells,
        leaning=np.array([one.leaning for one in frames]),
        own_axes=all(one.own_axes for one in frames),
        scan_values={
            "time_s": np.array([one.time_s for one in frames]),
            "speed_mps": np.array([float(np.linalg.norm(one.ego.velocity_mps)) for one in frames]),
            "acceleration_mps2": np.array([one.ego.forward_acceleration_mps2 for one in frames]),
            "yaw_rate_radps": np.array([one.ego.yaw_rate_radps for one in frames]),
        },
        **joined,
    )


def _choose(
    frame: TracedFrame, share: int, rng: np.random.Generator, edges: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Beams, how many each stands for, and the row of each one's partner."""
    solid, rings = frame.shot.hits.solid, frame.shot.rays.ring
    usable = frame.observed.trusted & (edges | ~frame.edge)
    residual = np.abs(frame.observed.range_from(frame.shot.rays.origin) - solid.range_m)
    odd = frame.observed.returned & ~(residual < _MATCHED_M)
    odd &= usable
    chance = np.where(solid.instance >= 0, 3.0, np.where(solid.exists, 1.0, 0.15)) * usable
    chance = np.clip(chance * (share / 2 / max(chance.sum(), 1.0)), 0, 1)
    chance = np.where(odd, np.maximum(chance, min(1.0, _ODD_SHARE * share / max(odd.sum(), 1))), chance)
    chance = np.maximum(chance, _rare(solid.material, usable & solid.exists, _RARE_SHARE * share))
    first = rng.random(len(chance)) < chance
    taken = (first | np.append(False, first[:-1])) & usable
    before = np.append(0.0, chance[:-1])
    beams = np.flatnonzero(taken)
    lone = _lone(frame, share, rng)
    weight = 1 / (1 - (1 - chance[beams]) * (1 - before[beams]))
    follows = np.append(np.diff(beams) == 1, False)
    after = np.minimum(beams + 1, len(rings) - 1)
    follows &= (rings[beams] == rings[after]) & (solid.instance[beams] == solid.instance[after])
    follows &= solid.exists[beams] & solid.exists[after]
    partner = np.where(
        follows, np.arange(len(beams)) + 1, np.where(np.append(False, follows[:-1]), np.arange(len(beams)) - 1, -1)
    )
    if not len(lone):
        return beams, weight, partner
    weight = np.append(weight, np.full(len(lone), weight.mean() if len(beams) else 1.0))
    order = np.argsort(np.append(beams, lone))
    place = np.argsort(order)
    partner = np.append(np.where(partner >= 0, place[partner], -1), np.full(len(lone), -1))
    return np.append(beams, lone)[order], weight[order], partner[order]


def _rare(material: np.ndarray, usable: np.ndarray, wanted: float) -> np.ndarray:
    """Chances (n,) by which as many usable beams of every material are taken, `wanted` in all."""
    count = np.bincount(material[usable], minlength=int(material.max(initial=0)) + 1)
    each = wanted / max(np.count_nonzero(count), 1)
    return np.where(usable, np.minimum(each / np.maximum(count, 1), 1.0)[material], 0.0)


def _lone(frame: TracedFrame, share: int, rng: np.random.Generator) -> np.ndarray:
    """Some returns that the twin knows nothing of, where points tell which way their beams look: as many a ring."""
    observed, rings = frame.observed, frame.shot.rays.ring
    if not observed.recovered:
        return np.zeros(0, int)
    beams = np.flatnonzero(observed.returned & ~observed.trusted)
    count = np.bincount(rings[beams], minlength=256)
    wanted = _LONE_SHARE * share / max(np.count_nonzero(count), 1)
    return beams[rng.random(len(beams)) < wanted / count[rings[beams]]]


def _columns(frame: TracedFrame, beams: np.ndarray) -> dict[str, np.ndarray]:
    observed, shot = frame.observed, frame.shot
    solid = shot.hits.solid.take(beams)
    assert shot.traced is not None  # frames are traced
    direction = shot.traced.direction[beams].astype(np.float64)
    normal = solid.normal.astype(np.float64)
    slope = np.einsum("ij,ij->i", normal, direction)
    reach = np.where(solid.instance == NOTHING, np.nan, solid.range_m).astype(np.float64)
    rotation = shot.hits.pose[:3, :3]
    ray = shot.rays.direction[beams].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = normal @ rotation / slope[:, None]  # normal in LiDAR axes over n·d
    moved = -turned
    spun = -np.cross(ray, turned) * np.nan_to_num(reach)[:, None]  # n·(w × d)/(n·d) = w·(d × n)/(n·d)
    pose = np.where(np.isfinite(reach)[:, None], np.hstack([moved, spun]), 0.0)
    place = shot.traced.origin[beams] + direction * np.nan_to_num(reach)[:, None]
    rays = shot.rays
    return {
        "along_m": observed.along_m[beams].astype(np.float64),
        "above_m": observed.above_m[beams].astype(np.float64),
        "intensity": observed.intensity[beams].astype(np.float64),
        "pose_derivative": np.nan_to_num(pose, posinf=0, neginf=0),
        "unsure_m": frame.unsure_m[beams].astype(np.float64),
        "unsure_intensity": frame.unsure_intensity[beams].astype(np.float64),
        "shared_m": _shared(frame)[beams],
        "edge": frame.edge[beams],
        "border": frame.border[beams],
        "seam": frame.seam[beams],
        "compared": observed.trusted[beams],
        "ring": rays.ring[beams].astype(int),
        "azimuth": rays.azimuth[beams].astype(np.float64),
        "time_s": rays.time_s[beams].astype(np.float64),
        "range_m": reach,
        "cos_incidence": np.minimum(np.abs(slope), 1),
        "material": solid.material.astype(int),
        "instance": solid.instance.astype(int),
        "place": place,
        "reflectance": shot.hits.reflectance(solid).astype(np.float64),
    }


def _shared(frame: TracedFrame) -> np.ndarray:
    own = (frame.exact or frame).unsure_m.astype(np.float64)
    return np.sqrt(np.maximum(frame.unsure_m.astype(np.float64) ** 2 - own**2, 0.0))


def _tracks(
    frames: Sequence[TracedFrame], frame: np.ndarray, instance: np.ndarray, place: np.ndarray, azimuth: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of instances by id, and of map cells for the static world; and these cells, see `Sample.cells`."""
    keys = np.empty(len(frame), object)
    for number, one in enumerate(frames):
        rows = np.flatnonzero((frame == number) & (instance >= 0))
        keys[rows] = [f"#{one.instances.ids[i]}" for i in instance[rows]]
    rest = np.flatnonzero(instance == STATIC)
    size_m = _OFF_CELL_M if any(one.scatter.map_m > 0 for one in frames) else CELL_M
    cells = np.floor(place[rest, :2] / size_m).astype(int).tolist()
    keys[rest] = [f"{frames[row].place} {x},{y}" for row, (x, y) in zip(frame[rest].tolist(), cells, strict=True)]
    sky = np.flatnonzero(instance == NOTHING)
    keys[sky] = [f"sky {sector}" for sector in np.floor(azimuth[sky] / _SKY_RAD).astype(int)]
    names, track = np.unique(keys.astype(str), return_inverse=True)
    worlds = np.unique([one.place for one in frames], return_inverse=True)[1]
    middles = np.full((len(names), 3), np.nan)
    middles[track[rest], 0] = worlds[frame[rest]]
    middles[track[rest], 1:] = (np.array(cells).reshape(-1, 2) + 0.5) * size_m
    return track, middles
