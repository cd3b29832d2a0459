"""Stored hits: what `hits/NAME.npz` holds, without loss against the traced hits.

Ranges are differences along each ring in steps of 0.1 mm, split into byte planes, so that deflate finds the
smoothness of surfaces. Material rows are stored with their names, so the table may grow.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np

from assets.materials import MATERIAL_NAMES, material_index
from sensors.errors import SensorError
from sensors.hits import NOTHING, RANGE_STEP_M, Hits, Surface
from sensors.npz import npz_bytes
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
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, KeyError) as error:
        raise SensorError(f"{path} is not a hits archive ({error}); make the frame again") from error
    wanted = [*_KEYS, *(f"{name}_{key}" for name in ("solid", "pane") for key in _SURFACE_KEYS)]
    missing = [key for key in wanted if key not in arrays]
    if missing:
        raise SensorError(f"{path} lacks {', '.join(missing)}; make the frame again")
    if int(arrays["beams"][0]) != len(rays):
        raise SensorError(
            f"{path} holds {int(arrays['beams'][0])} beams but the pattern has {len(rays)}; use the drive's own pattern"
        )
    rows = np.array([material_index(str(name)) for name in arrays["materials"]], np.uint8)
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
