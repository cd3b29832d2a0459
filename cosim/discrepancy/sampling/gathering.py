"""Collects measurements, derivatives and groups of chosen beams of traced frames into a `Sample`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosim.discrepancy.data.frames import TracedFrame
from cosim.discrepancy.forward.joined import SampleReplay
from cosim.discrepancy.forward.replay import FrameReplay
from cosim.discrepancy.sampling.sample import Sample
from cosim.discrepancy.settings import Sampling
from sensors.hits import NOTHING, STATIC, Surface

_ASIDE = {"previous": (0, -1), "above": (-1, 0), "below": (1, 0)}  # offsets in rings (downwards) and firings
BESIDE = tuple(f"{name}_{what}" for name in _ASIDE for what in ("range", "intensity", "lost"))

Taken = dict[str, np.ndarray]  # columns of the chosen rows of a frame, see `gather_sample`


def gather_sample(frames: Sequence[TracedFrame], chosen: Sequence[Taken]) -> Sample:
    """Collect the chosen beams of several frames into a sample.

    Args:
        frames: traced frames.
        chosen: columns of each frame's rows: `beam`, `weight` and `partner` as in `Sample`, rows counted within the
            frame. If beams have several rows, also `own`, `chance` and `edge` as in `Sample`, and `met`: the beam whose
            surface the row is for.
    """
    replays, columns, rows = [], [], 0
    for number, (frame, values) in enumerate(zip(frames, chosen, strict=True)):
        beams, count = values["beam"], len(values["beam"])
        values = {"own": np.arange(count), "chance": np.ones(count), "edge": np.zeros(count, bool)} | values
        beside = _neighbour_measurements(frame, beams)
        near = np.flatnonzero(values["edge"] & (values["own"] == np.arange(count)))
        values["surface_nearby"] = np.zeros(count, bool)
        values["surface_nearby"][near] = frame.has_surface_nearby(beams[near], frame.observed.along_m[beams[near]])
        replays.append(FrameReplay(frame, beams, beside, values.pop("met", beams)))
        values |= {"frame": np.full(count, number), "first": values["own"] == np.arange(count)}
        columns.append(values | _columns(frame, replays[-1].solid, values) | beside)
        for name in ("own", "partner"):
            columns[-1][name] = np.where(values[name] >= 0, values[name] + rows, -1)
        rows += count
    joined = {name: np.concatenate([part[name] for part in columns]) for name in columns[0]}
    track, names, cells = _number_tracks(
        frames, joined["frame"], joined["instance"], joined["place"], joined["azimuth"], frames[0].settings.sampling
    )
    types, kind = _name_indices(frames, joined["frame"], joined["instance"], "kinds")
    models, model = _name_indices(frames, joined["frame"], joined["instance"], "models")
    object_and_scan = np.where(joined["instance"] >= 0, track * len(frames) + joined["frame"], -1)
    beside = {name: joined.pop(name) for name in BESIDE}
    cell = joined["facing"] + max(6, int(joined["facing"].max(initial=0)) + 1) * track
    return Sample(
        object_scan=_renumber(object_and_scan),
        surface=_renumber(np.where(joined["instance"] == STATIC, cell, -1)),
        kind=kind,
        kinds=types,
        model=model,
        models=models,
        neighbour_values=beside,
        replay=SampleReplay(replays),
        settings=frames[0].settings,
        names=tuple(frame.name for frame in frames),
        track=track,
        track_names=names,
        cells=cells,
        own_axes=all(frame.own_axes for frame in frames),
        of_own_map=any(frame.map is not None for frame in frames),
        scan_values={
            "time_s": np.array([frame.time_s for frame in frames]),
            "speed_mps": np.array([float(np.linalg.norm(frame.ego.velocity_mps)) for frame in frames]),
            "acceleration_mps2": np.array([frame.ego.forward_acceleration_mps2 for frame in frames]),
            "yaw_rate_radps": np.array([frame.ego.yaw_rate_radps for frame in frames]),
        },
        **joined,
    )


def _columns(frame: TracedFrame, solid: Surface, chosen: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    observed, shot, beams, first = frame.observed, frame.shot, chosen["beam"], chosen["first"]
    assert shot.traced is not None  # frames are traced
    direction = shot.traced.direction[beams].astype(np.float64)
    normal = solid.normal.astype(np.float64)
    slope = np.einsum("ij,ij->i", normal, direction)
    # derivative of the range by a shift of the surface along its normal
    by_surface_shift = np.sign(slope) / np.maximum(np.abs(slope), frame.settings.beams.grazing)
    reach = np.where(solid.instance == NOTHING, np.nan, solid.range_m).astype(np.float64)
    rotation = shot.hits.pose[:3, :3]
    ray = shot.rays.direction[beams].astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        scaled_normal = normal @ rotation / slope[:, None]  # normal in LiDAR axes over n·d
    by_shift = -scaled_normal
    by_rotation = -np.cross(ray, scaled_normal) * np.nan_to_num(reach)[:, None]  # n·(w × d)/(n·d) = w·(d × n)/(n·d)
    pose = np.where(np.isfinite(reach)[:, None], np.hstack([by_shift, by_rotation]), 0.0)
    point = shot.traced.origin[beams] + direction * np.nan_to_num(reach)[:, None]
    rays, by_object_shift = shot.rays, normal * by_surface_shift[:, None]
    return {
        "along_m": np.where(first, observed.along_m[beams], np.nan).astype(np.float64),
        "above_m": observed.above_m[beams].astype(np.float64),
        "intensity": np.where(first, observed.intensity[beams], np.nan).astype(np.float64),
        "pose_derivative": np.nan_to_num(pose, posinf=0, neginf=0),
        "twin_sigma_m": frame.twin_sigma_m[beams].astype(np.float64),
        "twin_sigma_intensity": frame.twin_sigma_intensity[beams].astype(np.float64),
        "border": frame.border[beams] | chosen["edge"],
        "seam": frame.seam[beams],
        "compared": observed.trusted[beams],
        "at_end": frame.at_end[beams],
        "unmapped": frame.unmapped[beams],
        "object_derivative": _object_derivative(frame, solid.instance, by_object_shift, point),
        "surface_derivative": np.where(solid.instance == STATIC, by_surface_shift, 0.0),
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
        "place": point,
        "reflectance": shot.hits.reflectance(solid).astype(np.float64),
    }


def _facing(normal: np.ndarray) -> np.ndarray:
    """(n,) int nearest of six axis directions to each normal (n, 3): 2·axis, plus 1 if negative."""
    axis = np.argmax(np.abs(normal), axis=1)
    return 2 * axis + (normal[np.arange(len(normal)), axis] < 0)


def _object_derivative(frame: TracedFrame, instance: np.ndarray, by_shift: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Derivatives (n, 4) of range by shift and rotation of the object that is hit, see `Sample.object_derivative`."""
    derivative = np.zeros((len(instance), 4))
    rows = np.flatnonzero(instance >= 0)
    if len(rows):
        arm = point[rows] - frame.instances.poses[instance[rows], :3, 3]
        derivative[rows, :3] = by_shift[rows]
        derivative[rows, 3] = by_shift[rows, 1] * arm[:, 0] - by_shift[rows, 0] * arm[:, 1]
    return derivative


def _neighbour_measurements(frame: TracedFrame, beams: np.ndarray) -> dict[str, np.ndarray]:
    """(n,) measurements of neighbouring beams by name: range [m] and intensity, 0 for none; 1 if dropped."""
    pattern, observed, solid = frame.shot.pattern, frame.observed, frame.shot.hits.solid
    grid = (pattern.rings, pattern.firings)
    reach = np.nan_to_num(observed.along_m).reshape(grid)
    light = np.nan_to_num(observed.intensity).reshape(grid)
    lost = (solid.exists & ~observed.returned & observed.trusted).reshape(grid).astype(float)
    ring, firing = beams // pattern.firings, beams % pattern.firings
    measurements = {}
    for name, (down, along) in _ASIDE.items():
        other = np.clip(ring + down, 0, pattern.rings - 1), (firing + along) % pattern.firings
        exists = (ring + down == other[0]) & (firing + along >= 0)
        for what, values in (("range", reach), ("intensity", light), ("lost", lost)):
            measurements[f"{name}_{what}"] = np.where(exists, values[other], 0.0).astype(float)
    return measurements


def _name_indices(
    frames: Sequence[TracedFrame], frame: np.ndarray, instance: np.ndarray, what: str
) -> tuple[tuple[str, ...], np.ndarray]:
    """Names of instances' classes or models, and index (n,) of each beam's name; index 0 for no instance."""
    names = sorted({name for traced in frames for name in getattr(traced.instances, what)})
    index_of, index = {name: position + 1 for position, name in enumerate(names)}, np.zeros(len(frame), int)
    for number, traced in enumerate(frames):
        rows = np.flatnonzero((frame == number) & (instance >= 0))
        of_instance = np.array([index_of[name] for name in getattr(traced.instances, what)], int)
        if len(rows):
            index[rows] = of_instance[instance[rows]]
    return ("", *names), index


def _renumber(codes: np.ndarray) -> np.ndarray:
    """Renumber codes (n,) consecutively from 0; negative codes become −1."""
    numbers, used = np.full(len(codes), -1), codes >= 0
    numbers[used] = np.unique(codes[used], return_inverse=True)[1]
    return numbers


def _number_tracks(
    frames: Sequence[TracedFrame],
    frame: np.ndarray,
    instance: np.ndarray,
    position: np.ndarray,
    azimuth: np.ndarray,
    settings: Sampling,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Track number (n,) of each beam, by object id or map cell; names (tracks,); cells (tracks, 3) as in `Sample`."""
    places, worlds = np.unique([traced.place for traced in frames], return_inverse=True)
    keys = np.zeros((len(frame), 4), int)  # type of track (0 cell, 1 sky, 2 object), and three numbers that identify it
    is_static, is_sky = instance == STATIC, instance == NOTHING
    keys[is_static, 1] = worlds[frame[is_static]]
    keys[is_static, 2:] = np.floor(position[is_static, :2] / settings.cell_m)
    keys[is_sky, 0], keys[is_sky, 1] = 1, np.floor(azimuth[is_sky] / settings.sky_rad)
    is_object = instance >= 0
    keys[is_object, 0], keys[is_object, 1], keys[is_object, 2] = 2, frame[is_object], instance[is_object]
    each, number = _unique_rows(keys)
    names_of_keys = [_track_name(key, frames, places.tolist()) for key in each.tolist()]
    names, number_of_name = np.unique(np.array(names_of_keys, str), return_inverse=True)
    track = number_of_name[number]
    centres = np.full((len(names), 3), np.nan)
    static = each[:, 0] == 0
    centres[number_of_name[static], 0] = each[static, 1]
    centres[number_of_name[static], 1:] = (each[static, 2:] + 0.5) * settings.cell_m
    return track, names, centres


def _unique_rows(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unique rows of an integer table (n, 4), and the index (n,) of each row among them."""
    if not len(keys):
        return keys, np.zeros(0, int)
    low = keys.min(0)
    spans = keys.max(0) - low + 1
    code = np.ravel_multi_index(tuple((keys - low).T), tuple(spans))
    _, first, number = np.unique(code, return_index=True, return_inverse=True)
    return keys[first], number


def _track_name(key: Sequence[int], frames: Sequence[TracedFrame], worlds: Sequence[str]) -> str:
    kind, first, second, third = key
    if kind == 2:
        return f"#{frames[first].instances.ids[second]}"
    return f"sky {first}" if kind == 1 else f"{worlds[first]} {second},{third}"
