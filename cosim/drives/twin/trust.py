"""Beams that may be compared with a twin made from labels: `twin/trust/NAME.npz`.

Such a twin has only the ground around the vehicle and the labelled objects. The file marks *areas*, selected by the
evenness of the ground and the fit of its surface, never single points by their residuals: selecting points would remove
the tails of the residuals that are to be studied.

- A measured return is trusted over a trusted cell, within 0.3 m of the surface in height, or within 0.3 m of a labelled
  object's box.
- A traced hit is trusted if it is an instance, or static ground in a trusted cell.
- A beam is compared if its traced hit is trusted and its measured return, if any, is trusted as part of one object:
  the ground, or one box. Other returns are from unlabelled objects in front, or from differences between a model
  and the vehicle.
- The uncertainty of the twin is included: the scatter of points about the surface and about the models, in position and
  in brightness. Surfaces made from points and boxes are accurate to centimetres and decimetres, not to millimetres.
- `ground_range` is whether ranges on the ground are meaningful: if road is visible on one side only, a slope and an
  elevation error of the sensor cannot be distinguished. Intensities and lost returns are used in any case.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cosim.drives.files import read_bytes
from cosim.drives.twin.frame import Instance
from cosim.errors import FormatError
from sensors.npz import NpzError, npz_arrays, npz_bytes

CELL_M = 0.5
MARGIN_M = 0.3
_SINGLE = ("cell_m", "ground_range", "cone_deg", "lever_m", "ground_intensity_sd")
_ARRAYS = ("corner_m", "ground", "height_m", "height_sd_m", "body_sd_m", "body_intensity_sd", *_SINGLE)


@dataclass(frozen=True, eq=False)
class Trust:
    """Trusted ground of one frame, world axes.

    Attributes:
        corner_m: (2,) float64 x, y of the corner of the first cell.
        cell_m: size of a cell.
        ground: (k, m) bool by x, then y.
        height_m: (k, m) float32 world z of the surface at the middle of each cell.
        ground_range: whether ranges on the ground may be compared.
        cone_deg: opening of the cone seen in this frame's ground: an elevation error and the lie of the land.
        lever_m: how well it is known, see `GroundSurface`.
        height_sd_m: (k, m) float32, how far points scatter about the surface.
        ground_intensity_sd: how far intensities of the ground scatter.
        body_sd_m: (i,) float32 of each of the frame's instances, how far points in its box scatter about its model.
        body_intensity_sd: (i,) float32, how far their intensities scatter.
    """

    corner_m: np.ndarray
    cell_m: float
    ground: np.ndarray
    height_m: np.ndarray
    ground_range: bool
    cone_deg: float
    lever_m: float
    height_sd_m: np.ndarray
    ground_intensity_sd: float = 0.0
    body_sd_m: np.ndarray = field(default_factory=lambda: np.zeros(0, np.float32))
    body_intensity_sd: np.ndarray = field(default_factory=lambda: np.zeros(0, np.float32))

    @classmethod
    def nothing(cls) -> Trust:
        """No ground at all."""
        none = np.zeros((1, 1), np.float32)
        return cls(np.zeros(2), CELL_M, np.zeros((1, 1), bool), none, False, 0.0, 0.0, none)

    def ground_at(self, xy: np.ndarray) -> np.ndarray:
        """Whether places (n, 2) lie in trusted cells, (n,) bool; NaN places do not."""
        rows, inside = self._cells(xy)
        return inside & self.ground[tuple(rows)]

    def above_ground(self, xyz: np.ndarray) -> np.ndarray:
        """Heights (n,) of places (n, 3) above the surface, to about a centimetre; infinite outside the cells."""
        rows, inside = self._cells(xyz[:, :2])
        return np.where(inside, xyz[:, 2] - self.height_m[tuple(rows)], np.inf)

    def measured(self, xyz: np.ndarray, instances: Sequence[Instance]) -> np.ndarray:
        """(n,) bool measured returns from surfaces that the twin contains.

        Args:
            xyz: (n, 3) positions of the returns, world frame; NaN without a return.
            instances: of the frame.
        """
        trusted = self.ground_at(xyz[:, :2]) & (np.abs(self.above_ground(xyz)) <= MARGIN_M)
        for instance in instances:
            trusted |= in_box(xyz, instance, MARGIN_M)
        return trusted

    def traced(self, xyz: np.ndarray, instance: np.ndarray) -> np.ndarray:
        """(n,) bool traced hits on known surfaces.

        Args:
            xyz: (n, 3) positions of the hits, world frame; arbitrary without a hit.
            instance: (n,) rows of the instances, −1 the static world, −2 nothing.
        """
        return (instance >= 0) | ((instance == -1) & self.ground_at(xyz[:, :2]))

    def beams(
        self,
        instances: Sequence[Instance],
        traced: np.ndarray,
        instance: np.ndarray,
        measured: np.ndarray,
    ) -> np.ndarray:
        """(n,) bool beams that may be compared.

        Args:
            instances: of the frame.
            traced: (n, 3) positions of the traced hits, world frame; arbitrary without a hit.
            instance: (n,) rows of the instances hit, −1 the static world, −2 nothing.
            measured: (n, 3) positions of the measured returns, world frame; NaN without a return.
        """
        same = np.array(np.isnan(measured).any(axis=1), bool)
        on_ground = np.flatnonzero((instance == -1) & ~same)
        same[on_ground] = self.measured(measured[on_ground], ())
        for row, thing in enumerate(instances):
            on_it = np.flatnonzero((instance == row) & ~same)
            same[on_it] = in_box(measured[on_it], thing, MARGIN_M)
        return self.traced(traced, instance) & same

    def sigmas(self, traced: np.ndarray, instance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations of the twin where beams hit it: across its surface [m] and in brightness, (n,) each.

        Args:
            traced: (n, 3) positions of the traced hits, world frame; arbitrary without a hit.
            instance: (n,) rows of the instances hit, −1 the static world, −2 nothing.
        """
        rows, inside = self._cells(traced[:, :2])
        on_ground = inside & (instance == -1)
        away = np.where(on_ground, self.height_sd_m[tuple(rows)], np.float32(0))
        bright = np.where(on_ground, np.float32(self.ground_intensity_sd), np.float32(0))
        on_body = np.flatnonzero((instance >= 0) & (instance < len(self.body_sd_m)))
        away[on_body] = self.body_sd_m[instance[on_body]]
        bright[on_body] = self.body_intensity_sd[instance[on_body]]
        return away, bright

    def _cells(self, xy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = (np.asarray(xy, np.float64) - self.corner_m) / self.cell_m
        inside = np.all((position >= 0) & (position < self.ground.shape), axis=1)  # false for NaN
        return np.where(inside, position.T, 0).astype(int), np.asarray(inside)


def in_box(xyz: np.ndarray, instance: Instance, margin_m: float) -> np.ndarray:
    """(n,) bool points (n, 3) inside an instance's box, enlarged on every side."""
    local = (np.asarray(xyz, np.float64) - instance.pose[:3, 3]) @ instance.pose[:3, :3]
    half = np.array([instance.length_m, instance.width_m]) / 2 + margin_m
    level = (np.abs(local[:, :2]) <= half).all(1)
    return level & (local[:, 2] >= -margin_m) & (local[:, 2] <= instance.height_m + margin_m)


def encode_trust(trust: Trust) -> bytes:
    """The bytes of a file."""
    return npz_bytes(
        {
            "corner_m": np.asarray(trust.corner_m, np.float64),
            "cell_m": np.array([trust.cell_m]),
            "ground": trust.ground.astype(np.uint8),
            "height_m": np.round(trust.height_m, 4).astype(np.float32),
            "ground_range": np.array([trust.ground_range], np.uint8),
            "cone_deg": np.array([trust.cone_deg]),
            "lever_m": np.array([trust.lever_m]),
            "height_sd_m": np.round(trust.height_sd_m, 4).astype(np.float32),
            "ground_intensity_sd": np.array([trust.ground_intensity_sd]),
            "body_sd_m": np.round(trust.body_sd_m, 4).astype(np.float32),
            "body_intensity_sd": np.round(trust.body_intensity_sd, 4).astype(np.float32),
        }
    )


def read_trust(path: str | Path) -> Trust:
    """Read a file.

    Raises:
        FormatError: it is missing, not such an archive, or an array is missing or of the wrong shape.
    """
    try:
        archive = npz_arrays(read_bytes(path))
    except NpzError as error:
        raise FormatError(f"{path}: {error}; make the twin again") from None
    arrays = {name: archive[name] for name in _ARRAYS if name in archive}
    missing = [name for name in _ARRAYS if name not in arrays]
    if missing:
        raise FormatError(f"{path}: missing {', '.join(missing)}; make the twin again with `cosim twin`")
    ground, height = arrays["ground"], arrays["height_m"]
    single = [name for name in _SINGLE if arrays[name].size != 1]
    numeric = all(array.dtype.kind in "uif" and np.isfinite(array).all() for array in arrays.values())
    flat = ground.ndim == 2 and ground.size > 0 and ground.shape == height.shape and arrays["corner_m"].shape == (2,)
    flat &= arrays["height_sd_m"].shape == height.shape and arrays["body_sd_m"].ndim == 1
    flat &= arrays["body_sd_m"].shape == arrays["body_intensity_sd"].shape
    if single or not numeric or not flat or not arrays["cell_m"].item() > 0:
        raise FormatError(f"{path}: arrays of the wrong shape or kind; make the twin again with `cosim twin`")
    return Trust(
        corner_m=arrays["corner_m"].astype(np.float64),
        cell_m=arrays["cell_m"].item(),
        ground=ground != 0,
        height_m=height.astype(np.float32),
        ground_range=bool(arrays["ground_range"].item()),
        cone_deg=arrays["cone_deg"].item(),
        lever_m=arrays["lever_m"].item(),
        height_sd_m=arrays["height_sd_m"].astype(np.float32),
        ground_intensity_sd=arrays["ground_intensity_sd"].item(),
        body_sd_m=arrays["body_sd_m"].astype(np.float32),
        body_intensity_sd=arrays["body_intensity_sd"].astype(np.float32),
    )
