"""Stored hits, `hits/NAME.npz`: lossless copies of the traced hits.

Ranges are differences along each ring in steps of 0.1 mm, split into byte planes, so that deflate finds the
smoothness of surfaces. Material rows are stored with their names, so the table may grow.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from assets.materials import MATERIAL_NAMES, material_index
from sensors.errors import SensorError
from sensors.hits import NOTHING, RANGE_STEP_M, Hits, Surface
from sensors.npz import NpzError, npz_arrays, npz_bytes
from sensors.rays import Rays

_KEYS = ("pose", "paint", "pane_beam", "beams", "materials")
_SURFACE_KEYS = ("range", "normal_x", "normal_y", "material", "instance")


def encode_hits(hits: Hits) -> bytes:
    """The archive of a frame's hits."""
    arrays = {
        "beams": np.array([len(hits.rays)], np.int64),
        "pose": hits.pose,
        "paint": hits.paint,
        "materials": np.array(MATERIAL_NAMES),
        "pane_beam": hits.pane_beam,
    }
    for name, surface in (("solid", hits.solid), ("pane", hits.pane)):
        arrays[f"{name}_range"] = _range_planes(surface)
        arrays[f"{name}_normal_x"] = surface.normal_code[:, 0]
        arrays[f"{name}_normal_y"] = surface.normal_code[:, 1]
        arrays[f"{name}_material"] = surface.material
        arrays[f"{name}_instance"] = surface.instance
    return npz_bytes(arrays)


def load_hits(path: Path, rays: Rays) -> Hits:
    """Read a frame's hits; `rays` are those of the pattern it was traced with.

    Raises:
        SensorError: the file is damaged or belongs to another pattern.
    """
    try:
        arrays = npz_arrays(path.read_bytes())
    except (OSError, NpzError) as error:
        raise SensorError(f"{path} is not a hits archive ({error}); make the frame again") from error
    wanted = [*_KEYS, *(f"{name}_{key}" for name in ("solid", "pane") for key in _SURFACE_KEYS)]
    missing = [key for key in wanted if key not in arrays]
    if missing:
        raise SensorError(f"{path} lacks {', '.join(missing)}; make the frame again")
    beams = arrays["beams"]
    if beams.shape != (1,) or beams.dtype.kind != "i" or int(beams[0]) != len(rays):
        held = " ".join(map(str, beams.flat))
        raise SensorError(f"{path} holds {held} beams but the pattern has {len(rays)}; use the drive's own pattern")
    try:
        rows = np.array([material_index(str(name)) for name in arrays["materials"]], np.uint8)
        _check(arrays, len(rays), len(rows))
    except (KeyError, ValueError) as error:
        raise SensorError(f"{path} is damaged: {error}; make the frame again") from error
    surfaces = {
        name: Surface(
            range_m=_ranges(arrays[f"{name}_range"], arrays[f"{name}_instance"]),
            normal_code=np.stack([arrays[f"{name}_normal_x"], arrays[f"{name}_normal_y"]], 1),
            material=rows[arrays[f"{name}_material"]],
            instance=arrays[f"{name}_instance"],
        )
        for name in ("solid", "pane")
    }
    return Hits(rays, arrays["pose"], surfaces["solid"], arrays["pane_beam"], surfaces["pane"], arrays["paint"])


def _check(arrays: Mapping[str, np.ndarray], beams: int, materials: int) -> None:
    """Raise ValueError where arrays are not of the shapes, kinds and values that `encode_hits` writes."""
    panes, instances = len(arrays["pane_beam"]), len(arrays["paint"])
    expected = {"pose": (np.float64, (4, 4)), "paint": (np.float32, (instances,)), "pane_beam": (np.int32, (panes,))}
    for name, count in (("solid", beams), ("pane", panes)):
        expected[f"{name}_range"] = (np.uint8, (4, count))
        expected |= {f"{name}_{key}": (np.int16, (count,)) for key in ("normal_x", "normal_y", "instance")}
        expected[f"{name}_material"] = (np.uint8, (count,))
    for name, (dtype, shape) in expected.items():
        if arrays[name].dtype != dtype or arrays[name].shape != shape:
            raise ValueError(f"{name} is {arrays[name].dtype} {arrays[name].shape}, not {np.dtype(dtype)} {shape}")
    for name in ("pose", "paint"):
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"{name} is not finite")
    for name, least, most in (
        ("pane_beam", 0, beams),
        ("solid_material", 0, materials),
        ("pane_material", 0, materials),
        ("solid_instance", NOTHING, instances),
        ("pane_instance", NOTHING, instances),
    ):
        if not ((arrays[name] >= least) & (arrays[name] < most)).all():
            raise ValueError(f"{name} lies outside {least}…{most - 1}")


def _range_planes(surface: Surface) -> np.ndarray:
    """(4, n) uint8: bytes of the zigzag differences of the range steps, low byte first."""
    finite = np.where(surface.exists, surface.range_m, 0)
    steps = np.rint(finite / np.float32(RANGE_STEP_M)).astype(np.int32)
    change = np.diff(steps, prepend=np.int32(0))
    zigzag = ((change << 1) ^ (change >> 31)).astype("<u4")
    return np.ascontiguousarray(zigzag.view(np.uint8).reshape(-1, 4).T)


def _ranges(planes: np.ndarray, instance: np.ndarray) -> np.ndarray:
    zigzag = np.ascontiguousarray(planes.T).view("<u4").reshape(-1)
    change = (zigzag >> 1).astype(np.int32) ^ -(zigzag & 1).astype(np.int32)
    steps = np.cumsum(change, dtype=np.int32)
    ranges = steps.astype(np.float32) * np.float32(RANGE_STEP_M)
    ranges[instance == NOTHING] = np.inf
    return ranges
