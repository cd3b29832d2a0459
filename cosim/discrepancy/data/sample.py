"""A sample of beams of a whole drive, with what was measured of them and what else they have in common."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.forward.joined import Replay
from cosim.discrepancy.forward.replay import FrameReplay
from cosim.discrepancy.settings import Sampling, Settings
from sensors.effects.base import Effect
from sensors.hits import NOTHING, STATIC

_ASIDE = {"previous": (0, -1), "above": (-1, 0), "below": (1, 0)}  # rings down, and firings along
BESIDE = tuple(f"{name}_{what}" for name in _ASIDE for what in ("range", "intensity", "lost"))


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


@dataclass(frozen=True, eq=False)
class Sample:
    """n beams of some frames.

    Attributes:
        replay: of the beams.
        frame: (n,) int row of `names`.
        beam: (n,) int row of the frame's beams.
        names: of the frames, in order of time.
        weight: (n,) how many beams each stands for.
        along_m, above_m, intensity: (n,) measured, as in `Observed`; NaN where nothing returned.
        track: (n,) int what beams share errors with over time: an instance, or a cell of the map.
        track_names: (tracks,) str of each: an object's id, a cell of the plan, a sector of the sky.
        cells: (tracks, 3) number of the world and middle [m] of each cell of a map; NaN of other tracks.
        pose_derivative: (n, 6) change of range per metre and radian of the LiDAR's pose, in its own axes.
        unsure_m, unsure_intensity: (n,) how far the twin itself may be off, see `TracedFrame`.
        object_derivative: (n, 4) change of range by a shift of the object that is met, in world axes [m/m], and by its
            turn about the vertical through its origin [m/rad]; 0 elsewhere.
        object_scan: (n,) int number of the object in this scan; −1 elsewhere.
        facing: (n,) int which of six directions the surface's normal is nearest to; the surface's row in a map that
            was made of the scans.
        surface: (n,) int number of the cell of the static world: a square of the ground plan and a direction of its
            normal; −1 elsewhere.
        surface_derivative: (n,) change of range by a shift of that cell along its normal [m/m]; 0 elsewhere.
        edge: (n,) bool ambiguous beams.
        border: (n,) bool beams of ambiguous brightness.
        seam: (n,) bool the same, where the brightness itself tells whose it is.
        compared: (n,) bool: beams that can be compared with the twin; of others it only tells something where their
            returns stand above them.
        partner: (n,) int row of the beam fired just before or after at the same surface, −1 where there is none:
            their difference knows nothing of errors that both share.
        ring, firing, block, material, instance: (n,) int.
        elevation_deg: (n,) nominal.
        kind, model: (n,) int rows of `kinds` and `models`, what is met; 0 for the static world and nothing.
        kinds, models: names.
        reflectance: (n,) of the surface.
        beside: by name, (n,) what beams beside each measured: `previous` of its ring, `above` and `below` it; ranges
            [m] and intensities are 0 where nothing returned, `lost` is 1 where a surface should have been seen.
        leaning: (scans, 6) pose errors that were traced with, see `TracedFrame`.
        own_axes: whether scans stand where their twins were made, so that poses have no errors.
        of_own_map: whether the twin is a map made of the scans: places of surfaces and scans are free.
        scan_values: by name, (scans,) pose time, and the ego vehicle's speed, acceleration and yaw rate.
        azimuth, time_s, range_m, cos_incidence: (n,) of the beams as traced.
        settings: those that frames were traced with.
    """

    replay: Replay
    frame: np.ndarray
    beam: np.ndarray
    names: tuple[str, ...]
    weight: np.ndarray
    along_m: np.ndarray
    above_m: np.ndarray
    intensity: np.ndarray
    track: np.ndarray
    track_names: np.ndarray
    facing: np.ndarray
    cells: np.ndarray
    pose_derivative: np.ndarray
    unsure_m: np.ndarray
    unsure_intensity: np.ndarray
    object_derivative: np.ndarray
    object_scan: np.ndarray
    surface: np.ndarray
    surface_derivative: np.ndarray
    edge: np.ndarray
    border: np.ndarray
    seam: np.ndarray
    compared: np.ndarray
    partner: np.ndarray
    ring: np.ndarray
    firing: np.ndarray
    block: np.ndarray
    elevation_deg: np.ndarray
    kind: np.ndarray
    model: np.ndarray
    kinds: tuple[str, ...]
    models: tuple[str, ...]
    azimuth: np.ndarray
    time_s: np.ndarray
    range_m: np.ndarray
    cos_incidence: np.ndarray
    material: np.ndarray
    instance: np.ndarray
    place: np.ndarray
    reflectance: np.ndarray
    beside: dict[str, np.ndarray]
    leaning: np.ndarray
    own_axes: bool
    of_own_map: bool
    scan_values: dict[str, np.ndarray]
    settings: Settings

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

    def reported_range(self, effects: Sequence[Effect]) -> np.ndarray:
        """(n,) measured ranges from where effects have the optical centre stand [m]; NaN where nothing returned."""
        found = [replay.ranges(effects, self.along_m[rows], self.above_m[rows]) for replay, rows in self._frames()]
        return np.concatenate(found)

    def moved(self, effects: Sequence[Effect]) -> tuple[float, float]:
        """How far effects turn [rad] and shift [m] beams from where they were traced: nearly all that returned."""
        used = self.compared & self.returned
        found = [replay.moved(effects, used[rows]) for replay, rows in self._frames()]
        return max(turn for turn, _ in found), max(shift for _, shift in found)

    def predict(self, effects: Sequence[Effect]) -> Prediction:
        """What effects let expect of the sample's beams."""
        effects = tuple(sorted(effects, key=lambda effect: effect.phase))
        found = self.replay.expect(effects)
        return Prediction(
            range_m=found.of.range_m + found.along_m,
            range_sigma_m=found.of.range_sigma_m,
            rise_m=found.above_m,
            intensity=found.of.intensity,
            intensity_sigma=found.of.intensity_sigma,
            seen=found.of.seen,
            silent=found.of.silent,
            stray=found.stray,
            unsure_m=self.unsure_m,
            unsure_intensity=self.unsure_intensity,
        )

    def clear_of(self, ambiguous: Sequence[np.ndarray]) -> Sample:
        """The same without beams that are ambiguous: (n,) bool of every frame's beams."""
        off = np.zeros(len(self), bool)
        for number, mask in enumerate(ambiguous):
            mine = self.frame == number
            off[mine] = mask[self.beam[mine]]
        partner = np.where(off | off[np.maximum(self.partner, 0)], -1, self.partner)
        return replace(self, compared=self.compared & ~off, edge=self.edge | off, partner=partner)

    def _frames(self) -> Iterator[tuple[FrameReplay, np.ndarray]]:
        for number, replay in enumerate(self.replay.frames):
            yield replay, self.frame == number


def draw_sample(
    frames: Sequence[TracedFrame],
    count: int,
    rng: np.random.Generator,
    *,
    edges: bool = False,
    judging: bool | None = None,
) -> Sample:
    """A sample of about `count` beams in neighbouring pairs: of every frame alike, more of objects than of the rest.

    Materials that few beams meet, as those of plates and signs, are taken nearly whole.


    Args:
        frames: in order of time.
        count: how many beams to take, roughly.
        rng: for the draw.
        edges: whether ambiguous beams take part.
        judging: of a map made of the scans, take surfaces of those places that judge, or of the others; all by default.
    """
    if frames and frames[0].map is not None:
        return _gathered(frames, _of_maps(frames, count, rng, edges, judging))
    share = max(count // max(len(frames), 1), 1)
    return _gathered(frames, [_choose(frame, share, rng, edges) for frame in frames])


def whole_sample(frame: TracedFrame) -> Sample:
    """All beams of one frame."""
    count = len(frame.observed.rays)
    return _gathered([frame], [(np.arange(count), np.ones(count), np.full(count, -1))])


def _gathered(frames: Sequence[TracedFrame], chosen: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> Sample:
    replays, columns, rows = [], [], 0
    for number, (frame, (beams, weight, partner)) in enumerate(zip(frames, chosen, strict=True)):
        beside = _beside(frame, beams)
        replays.append(FrameReplay(frame, beams, beside))
        partner = np.where(partner >= 0, partner + rows, -1)
        columns.append(
            {"frame": np.full(len(beams), number), "beam": beams, "weight": weight, "partner": partner}
            | _columns(frame, beams)
            | beside
        )
        rows += len(beams)
    joined = {name: np.concatenate([one[name] for one in columns]) for name in columns[0]}
    track, names, cells = _tracks(
        frames, joined["frame"], joined["instance"], joined["place"], joined["azimuth"], frames[0].settings.sampling
    )
    kinds, kind = _named(frames, joined["frame"], joined["instance"], "kinds")
    models, model = _named(frames, joined["frame"], joined["instance"], "models")
    thing = np.where(joined["instance"] >= 0, track * len(frames) + joined["frame"], -1)
    beside = {name: joined.pop(name) for name in BESIDE}
    cell = joined["facing"] + max(6, int(joined["facing"].max(initial=0)) + 1) * track
    return Sample(
        object_scan=_numbered(thing),
        surface=_numbered(np.where(joined["instance"] == STATIC, cell, -1)),
        kind=kind,
        kinds=kinds,
        model=model,
        models=models,
        beside=beside,
        replay=Replay(replays),
        settings=frames[0].settings,
        names=tuple(one.name for one in frames),
        track=track,
        track_names=names,
        cells=cells,
        leaning=np.array([one.leaning for one in frames]),
        own_axes=all(one.own_axes for one in frames),
        of_own_map=any(one.map is not None for one in frames),
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
    solid, rings, settings = frame.shot.hits.solid, frame.shot.rays.ring, frame.settings.sampling
    usable = frame.observed.trusted & (edges | ~frame.edge)
    residual = np.abs(frame.observed.range_from(frame.shot.rays.origin) - solid.range_m)
    odd = frame.observed.returned & ~(residual < frame.settings.beams.same_m)
    odd &= usable
    chance = np.where(solid.instance >= 0, 3.0, np.where(solid.exists, 1.0, 0.15)) * usable
    chance = np.clip(chance * (share / 2 / max(chance.sum(), 1.0)), 0, 1)
    chance = np.where(odd, np.maximum(chance, min(1.0, settings.odd_share * share / max(odd.sum(), 1))), chance)
    chance = np.maximum(chance, _rare(solid.material, usable & solid.exists, settings.rare_share * share))
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


def _of_maps(
    frames: Sequence[TracedFrame], count: int, rng: np.random.Generator, edges: bool, judging: bool | None
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """As `_choose`, for each frame; of each map as many beams as frames lie in it."""
    by_place: dict[str, list[int]] = {}
    for number, one in enumerate(frames):
        by_place.setdefault(one.place, []).append(number)
    found = {}
    for numbers in by_place.values():
        mine = [frames[number] for number in numbers]
        found |= dict(zip(numbers, _of_map(mine, count * len(mine) // len(frames), rng, edges, judging), strict=True))
    return [found[number] for number in range(len(frames))]


def _of_map(
    frames: Sequence[TracedFrame], count: int, rng: np.random.Generator, edges: bool, judging: bool | None
) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """As `_choose`, for each frame: several looks at each of some surfaces, rather at those seen from near and far."""
    surfaces = frames[0].map
    assert surfaces is not None  # asked before
    usable = [np.flatnonzero(one.observed.trusted & (edges | ~one.edge)) for one in frames]
    met = np.concatenate([one.surface[rows] for one, rows in zip(frames, usable, strict=True)])
    most, looks = frames[0].settings.sampling.looks, np.bincount(met, minlength=len(surfaces))
    if judging is not None:
        looks = np.where(surfaces.judge == judging, looks, 0)
    taken = surfaces.drawn(np.minimum(looks, most), count, rng)
    chance = np.zeros(len(surfaces))
    chance[taken] = np.minimum(most / looks[taken] / 2, 1.0)
    found = []
    for one, rows in zip(frames, usable, strict=True):
        first = rows[rng.random(len(rows)) < chance[one.surface[rows]]]
        beside = np.minimum(first + 1, len(one.surface) - 1)
        pairs = one.surface[beside] == one.surface[first]
        beams = np.intersect1d(np.append(first, beside[pairs]), rows)
        found.append((beams, np.ones(len(beams)), _partners(beams, one)))
    return found


def _partners(beams: np.ndarray, frame: TracedFrame) -> np.ndarray:
    """Row (n,) of the beam fired just before or after each at the same surface of a map; −1 where it is not taken."""
    follows = (np.diff(beams) == 1) & (np.diff(frame.surface[beams]) == 0)
    follows &= np.diff(frame.shot.rays.ring[beams].astype(int)) == 0
    rows = np.arange(len(beams))
    after, before = np.append(follows, False)[: len(beams)], np.append(False, follows)[: len(beams)]
    return np.where(after, rows + 1, np.where(before, rows - 1, -1))


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
    wanted = frame.settings.sampling.lone_share * share / max(np.count_nonzero(count), 1)
    return beams[rng.random(len(beams)) < wanted / count[rings[beams]]]


def _columns(frame: TracedFrame, beams: np.ndarray) -> dict[str, np.ndarray]:
    observed, shot = frame.observed, frame.shot
    solid = shot.hits.solid.take(beams)
    assert shot.traced is not None  # frames are traced
    direction = shot.traced.direction[beams].astype(np.float64)
    normal = solid.normal.astype(np.float64)
    slope = np.einsum("ij,ij->i", normal, direction)
    steep = np.sign(slope) / np.maximum(np.abs(slope), frame.settings.beams.grazing)  # change of range by a shift
    reach = np.where(solid.instance == NOTHING, np.nan, solid.range_m).astype(np.float64)
    rotation = shot.hits.pose[:3, :3]
    ray = shot.rays.direction[beams].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = normal @ rotation / slope[:, None]  # normal in LiDAR axes over n·d
    moved = -turned
    spun = -np.cross(ray, turned) * np.nan_to_num(reach)[:, None]  # n·(w × d)/(n·d) = w·(d × n)/(n·d)
    pose = np.where(np.isfinite(reach)[:, None], np.hstack([moved, spun]), 0.0)
    place = shot.traced.origin[beams] + direction * np.nan_to_num(reach)[:, None]
    rays, toward = shot.rays, normal * steep[:, None]
    return {
        "along_m": observed.along_m[beams].astype(np.float64),
        "above_m": observed.above_m[beams].astype(np.float64),
        "intensity": observed.intensity[beams].astype(np.float64),
        "pose_derivative": np.nan_to_num(pose, posinf=0, neginf=0),
        "unsure_m": frame.unsure_m[beams].astype(np.float64),
        "unsure_intensity": frame.unsure_intensity[beams].astype(np.float64),
        "edge": frame.edge[beams],
        "border": frame.border[beams],
        "seam": frame.seam[beams],
        "compared": observed.trusted[beams],
        "object_derivative": _of_object(frame, solid.instance, toward, place),
        "surface_derivative": np.where(solid.instance == STATIC, steep, 0.0),
        "facing": _facing(normal) if frame.map is None else np.maximum(frame.surface[beams], 0).astype(int),
        "ring": rays.ring[beams].astype(int),
        "firing": beams % frame.shot.pattern.firings,
        "block": shot.block[beams].astype(int),
        "elevation_deg": np.degrees(np.arcsin(np.clip(ray[:, 2], -1, 1))),
        "azimuth": rays.azimuth[beams].astype(np.float64),
        "time_s": rays.time_s[beams].astype(np.float64),
        "range_m": reach,
        "cos_incidence": np.minimum(np.abs(slope), 1),
        "material": solid.material.astype(int),
        "instance": solid.instance.astype(int),
        "place": place,
        "reflectance": shot.hits.reflectance(solid).astype(np.float64),
    }


def _facing(normal: np.ndarray) -> np.ndarray:
    """Which of six directions a normal (n, 3) is nearest to, (n,) int."""
    axis = np.argmax(np.abs(normal), axis=1)
    return 2 * axis + (normal[np.arange(len(normal)), axis] < 0)


def _of_object(frame: TracedFrame, instance: np.ndarray, toward: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Change of range (n, 4) by a shift of the object that is met and by its turn, see `Sample.object_derivative`."""
    found = np.zeros((len(instance), 4))
    rows = np.flatnonzero(instance >= 0)
    if len(rows):
        arm = place[rows] - frame.instances.poses[instance[rows], :3, 3]
        found[rows, :3] = toward[rows]
        found[rows, 3] = toward[rows, 1] * arm[:, 0] - toward[rows, 0] * arm[:, 1]
    return found


def _beside(frame: TracedFrame, beams: np.ndarray) -> dict[str, np.ndarray]:
    """What beams beside each measured, by name: (n,) range [m] and intensity, 0 for none; and 1 where it was lost."""
    pattern, observed, solid = frame.shot.pattern, frame.observed, frame.shot.hits.solid
    grid = (pattern.rings, pattern.firings)
    reach = np.nan_to_num(observed.along_m).reshape(grid)
    light = np.nan_to_num(observed.intensity).reshape(grid)
    lost = (solid.exists & ~observed.returned & observed.trusted).reshape(grid).astype(float)
    ring, firing = beams // pattern.firings, beams % pattern.firings
    found = {}
    for name, (down, along) in _ASIDE.items():
        other = np.clip(ring + down, 0, pattern.rings - 1), (firing + along) % pattern.firings
        there = (ring + down == other[0]) & (firing + along >= 0)
        for what, values in (("range", reach), ("intensity", light), ("lost", lost)):
            found[f"{name}_{what}"] = np.where(there, values[other], 0.0).astype(float)
    return found


def _named(
    frames: Sequence[TracedFrame], frame: np.ndarray, instance: np.ndarray, what: str
) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of what instances are, and the row (n,) of each beam's; row 0 is for what is no instance."""
    names = sorted({name for one in frames for name in getattr(one.instances, what)})
    row, found = {name: place + 1 for place, name in enumerate(names)}, np.zeros(len(frame), int)
    for number, one in enumerate(frames):
        mine = np.flatnonzero((frame == number) & (instance >= 0))
        of_instance = np.array([row[name] for name in getattr(one.instances, what)], int)
        if len(mine):
            found[mine] = of_instance[instance[mine]]
    return ("", *names), found


def _numbered(codes: np.ndarray) -> np.ndarray:
    """Codes (n,) numbered from 0 on; those below 0 are −1."""
    found, used = np.full(len(codes), -1), codes >= 0
    found[used] = np.unique(codes[used], return_inverse=True)[1]
    return found


def _tracks(
    frames: Sequence[TracedFrame],
    frame: np.ndarray,
    instance: np.ndarray,
    place: np.ndarray,
    azimuth: np.ndarray,
    settings: Sampling,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of instances by id, and of map cells for the static world; their names, and the cells' places."""
    places, worlds = np.unique([one.place for one in frames], return_inverse=True)
    keys = np.zeros((len(frame), 4), int)  # of what kind, and three numbers that tell which
    rest, sky = instance == STATIC, instance == NOTHING
    keys[rest, 1] = worlds[frame[rest]]
    keys[rest, 2:] = np.floor(place[rest, :2] / settings.cell_m)
    keys[sky, 0], keys[sky, 1] = 1, np.floor(azimuth[sky] / settings.sky_rad)
    met = instance >= 0
    keys[met, 0], keys[met, 1], keys[met, 2] = 2, frame[met], instance[met]
    each, number = _numbered_rows(keys)
    told = [_track_name(key, frames, places.tolist()) for key in each.tolist()]
    names, same = np.unique(np.array(told, str), return_inverse=True)
    track = same[number]
    middles = np.full((len(names), 3), np.nan)
    static = each[:, 0] == 0
    middles[same[static], 0] = each[static, 1]
    middles[same[static], 1:] = (each[static, 2:] + 0.5) * settings.cell_m
    return track, names, middles


def _numbered_rows(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Different rows of a table (n, 4) of integers, and which of them each row is."""
    if not len(keys):
        return keys, np.zeros(0, int)
    low = keys.min(0)
    spans = keys.max(0) - low + 1
    code = np.ravel_multi_index(tuple((keys - low).T), tuple(spans))
    _, first, number = np.unique(code, return_index=True, return_inverse=True)
    return keys[first], number


def _track_name(key: Sequence[int], frames: Sequence[TracedFrame], places: Sequence[str]) -> str:
    kind, first, second, third = key
    if kind == 2:
        return f"#{frames[first].instances.ids[second]}"
    return f"sky {first}" if kind == 1 else f"{places[first]} {second},{third}"
