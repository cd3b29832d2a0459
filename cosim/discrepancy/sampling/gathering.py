"""Gathers what is known of some beams of traced frames into a sample."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.forward.joined import Replay
from cosim.discrepancy.forward.replay import FrameReplay
from cosim.discrepancy.sampling.sample import Sample
from cosim.discrepancy.settings import Sampling
from sensors.hits import NOTHING, STATIC, Surface

_ASIDE = {"previous": (0, -1), "above": (-1, 0), "below": (1, 0)}  # rings down, and firings along
BESIDE = tuple(f"{name}_{what}" for name in _ASIDE for what in ("range", "intensity", "lost"))

Taken = dict[str, np.ndarray]  # rows of a frame, see `gathered`


def gathered(frames: Sequence[TracedFrame], chosen: Sequence[Taken]) -> Sample:
    """A sample of frames.

    Args:
        frames: traced.
        chosen: of each its rows: `beam`, `weight` and `partner` as in `Sample`, rows counted within the frame. Where
            beams have several, `own`, `chance` and `edge`, too, and `met`: the beam whose surface a row is about.
    """
    replays, columns, rows = [], [], 0
    for number, (frame, told) in enumerate(zip(frames, chosen, strict=True)):
        beams, count = told["beam"], len(told["beam"])
        told = {"own": np.arange(count), "chance": np.ones(count), "edge": np.zeros(count, bool)} | told
        beside = _beside(frame, beams)
        replays.append(FrameReplay(frame, beams, beside, told.pop("met", beams)))
        told |= {"frame": np.full(count, number), "first": told["own"] == np.arange(count)}
        columns.append(told | _columns(frame, replays[-1].solid, told) | beside)
        for name in ("own", "partner"):
            columns[-1][name] = np.where(told[name] >= 0, told[name] + rows, -1)
        rows += count
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


def _columns(frame: TracedFrame, solid: Surface, told: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    observed, shot, beams, first = frame.observed, frame.shot, told["beam"], told["first"]
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
        "along_m": np.where(first, observed.along_m[beams], np.nan).astype(np.float64),
        "above_m": observed.above_m[beams].astype(np.float64),
        "intensity": np.where(first, observed.intensity[beams], np.nan).astype(np.float64),
        "pose_derivative": np.nan_to_num(pose, posinf=0, neginf=0),
        "unsure_m": frame.unsure_m[beams].astype(np.float64),
        "unsure_intensity": frame.unsure_intensity[beams].astype(np.float64),
        "border": frame.border[beams] | told["edge"],
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
