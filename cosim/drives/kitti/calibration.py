"""Camera and LiDAR calibration in KITTI's object format: `calib/NAME.txt`.

A point p in LiDAR axes (x forward, y left, z up) lies at R0_rect · Tr_velo_to_cam · p in rectified camera
axes (x right, y down, z forward, origin in camera 0), and at P_i · that in the pixels of camera i.
Geiger et al., "Vision meets Robotics: The KITTI Dataset", IJRR 2013, section IV.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim.drives.files import numbers, read_text
from cosim.errors import FormatError

_SHAPES = {
    "P0": (3, 4),
    "P1": (3, 4),
    "P2": (3, 4),
    "P3": (3, 4),
    "R0_rect": (3, 3),
    "Tr_velo_to_cam": (3, 4),
    "Tr_imu_to_velo": (3, 4),
}
_SPELLINGS = {
    "R_rect": "R0_rect",
    "Tr_velo_cam": "Tr_velo_to_cam",
    "Tr_imu_velo": "Tr_imu_to_velo",
    "Tr": "Tr_velo_to_cam",
}
_MANDATORY = ("P2", "R0_rect", "Tr_velo_to_cam")
VELO_TO_CAM, CAM_TO_CAM, _IMU_TO_VELO = "calib_velo_to_cam.txt", "calib_cam_to_cam.txt", "calib_imu_to_velo.txt"
"""Files of a day of KITTI's raw drives."""
_NAMED_P, _NAMED_TR = "P_", "Tr_velo_to_rect_"


@dataclass(frozen=True, eq=False, kw_only=True)
class Calibration:
    """The matrices of one frame, float64. All but three may be absent (None).

    Attributes:
        P0, P1, P2, P3: (3, 4) projections from rectified camera axes to pixels. Column 4 is −f·b, b the
            camera's place along x of camera 0 [m].
        R0_rect: (3, 3) rotation from camera 0 to rectified axes.
        Tr_velo_to_cam: (3, 4) LiDAR to camera 0.
        Tr_imu_to_velo: (3, 4) IMU to LiDAR.
        named: of cameras that are not of KITTI's row, by name: (3, 4) projection from their own level axes to pixels,
            and (4, 4) LiDAR to those axes.
    """

    P2: np.ndarray
    R0_rect: np.ndarray
    Tr_velo_to_cam: np.ndarray
    P0: np.ndarray | None = None
    P1: np.ndarray | None = None
    P3: np.ndarray | None = None
    Tr_imu_to_velo: np.ndarray | None = None
    named: Mapping[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, shape in _SHAPES.items():
            value = getattr(self, name)
            if value is None and name not in _MANDATORY:
                continue
            matrix = np.array(value, np.float64)
            if matrix.shape != shape or not np.isfinite(matrix).all():
                raise FormatError(f"calibration: {name} has shape {matrix.shape}; give {shape}, all finite")
            matrix.setflags(write=False)
            object.__setattr__(self, name, matrix)
        if abs(np.linalg.det(self.velo_to_rect_matrix)) < 1e-6:
            raise FormatError("calibration: R0_rect · Tr_velo_to_cam is singular; both hold a rotation")

    @cached_property
    def velo_to_rect_matrix(self) -> np.ndarray:
        """LiDAR axes to rectified camera axes, (4, 4) float64."""
        matrix = np.eye(4)
        matrix[:3] = self.R0_rect @ self.Tr_velo_to_cam
        return matrix

    @cached_property
    def rect_to_velo_matrix(self) -> np.ndarray:
        """Rectified camera axes to LiDAR axes, (4, 4) float64."""
        return np.linalg.inv(self.velo_to_rect_matrix)

    def velo_to_rect(self, points: np.ndarray) -> np.ndarray:
        """Points (n, ≥ 3) in LiDAR axes as (n, 3) float64 in rectified camera axes."""
        return _carry(self.velo_to_rect_matrix, points)

    def rect_to_velo(self, points: np.ndarray) -> np.ndarray:
        """Points (n, ≥ 3) in rectified camera axes as (n, 3) float64 in LiDAR axes."""
        return _carry(self.rect_to_velo_matrix, points)

    def projection(self, camera: int = 2) -> np.ndarray:
        """The (3, 4) projection of a camera.

        Raises:
            FormatError: the calibration has none for that camera.
        """
        matrix = getattr(self, f"P{camera}", None)
        if matrix is None:
            raise FormatError(f"calibration has no P{camera}; cameras with a matrix: {self.cameras}")
        return matrix

    @property
    def cameras(self) -> tuple[int, ...]:
        """Numbers of the cameras that have a projection."""
        return tuple(camera for camera in range(4) if getattr(self, f"P{camera}") is not None)

    def to_pixels(self, camera: str) -> np.ndarray:
        """(3, 4) that carries homogeneous LiDAR axes to (u·d, v·d, d), d the depth [m].

        Args:
            camera: as in the folder `image_CAMERA`: a number, or a name.

        Raises:
            FormatError: the calibration has no such camera.
        """
        if camera in self.named:
            P, to_rect = self.named[camera]
            return P @ to_rect
        if not camera.isdecimal():
            raise FormatError(f"calibration has no P_{camera}; named cameras: {', '.join(self.named) or 'none'}")
        return self.projection(int(camera)) @ self.velo_to_rect_matrix

    def knows(self, camera: str) -> bool:
        """Whether there is a projection of a camera, see `to_pixels`."""
        return camera in self.named or (camera.isdecimal() and int(camera) in self.cameras)

    def project_rect(self, points_rect: np.ndarray, camera: int = 2) -> tuple[np.ndarray, np.ndarray]:
        """Pixels and depth of points (n, ≥ 3) in rectified camera axes; see `project`."""
        homogeneous = _carry(self.projection(camera), points_rect)
        depth = homogeneous[:, 2]
        uv = np.full((len(depth), 2), np.nan)
        np.divide(homogeneous[:, :2], depth[:, None], out=uv, where=depth[:, None] > 0)
        return uv, depth

    def project(self, points_velo: np.ndarray, camera: int = 2) -> tuple[np.ndarray, np.ndarray]:
        """Project points into an image.

        Args:
            points_velo: (n, ≥ 3) in LiDAR axes [m].
            camera: 0–3.

        Returns:
            uv (n, 2) float64 pixels, (0, 0) at the centre of the top left pixel, NaN at and behind the
            camera; depth (n,) float64 along that camera's optical axis [m].
        """
        return self.project_rect(self.velo_to_rect(points_velo), camera)


def parse_calibration(text: str, source: str | Path = "calibration") -> Calibration:
    """The calibration in the text of a file; also in the spelling of KITTI's tracking and odometry sets.

    A name without numbers, as `Tr_imu_to_velo:`, is a matrix that is not given; a rectification that is not given is
    the identity.

    Raises:
        FormatError: a matrix is missing, twice there, of the wrong size, not numeric or not finite.
    """
    matrices: dict[str, np.ndarray] = {}
    named: dict[str, np.ndarray] = {}
    for number, line in enumerate(text.splitlines(), 1):
        key, _, rest = line.strip().replace(":", " ", 1).partition(" ")
        name = _SPELLINGS.get(key, key)
        if name.startswith((_NAMED_P, _NAMED_TR)):
            named[name] = _matrix(rest.split(), (3, 4), f"{source}:{number}: {key}")
            continue
        if name not in _SHAPES:
            continue
        where = f"{source}:{number}: {key}"
        if name in matrices:
            raise FormatError(f"{where} is there twice; keep one")
        if rest.strip():
            matrices[name] = _matrix(rest.split(), _SHAPES[name], where)
        if name == "R0_rect" and not rest.strip():
            matrices[name] = np.eye(3)
        elif key == "Tr":  # of the odometry set, to rectified axes
            matrices.setdefault("R0_rect", np.eye(3))
    missing = [name for name in _MANDATORY if name not in matrices]
    if missing:
        raise FormatError(f"{source}: missing {', '.join(missing)}; a calibration needs {', '.join(_MANDATORY)}")
    try:
        return Calibration(**matrices, named=_pairs(named))
    except FormatError as error:
        raise FormatError(f"{source}: {error}") from None


def _matrix(words: list[str], shape: tuple[int, int], where: str) -> np.ndarray:
    if len(words) != shape[0] * shape[1]:
        raise FormatError(f"{where} has {len(words)} numbers; expected {shape[0]} × {shape[1]}")
    return np.reshape(numbers(words, where), shape)


def _pairs(matrices: Mapping[str, np.ndarray]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Projection and pose of named cameras."""
    found = {}
    for key, P in matrices.items():
        name = key.removeprefix(_NAMED_P)
        if not key.startswith(_NAMED_P):
            continue
        if _NAMED_TR + name not in matrices:
            raise FormatError(f"P_{name} has no {_NAMED_TR}{name}; give both")
        found[name] = P, np.vstack([matrices[_NAMED_TR + name], [0, 0, 0, 1]])
    return found


def format_calibration(calibration: Calibration) -> str:
    """The text of a calibration file, byte for byte as KITTI writes it; absent matrices are left out."""
    lines = []
    for name in _SHAPES:
        matrix = getattr(calibration, name)
        if matrix is not None:
            lines.append(_line(name, matrix))
    for name, (P, to_rect) in calibration.named.items():
        lines += [_line(_NAMED_P + name, P), _line(_NAMED_TR + name, to_rect[:3])]
    return "".join(lines) + "\n"


def _line(name: str, matrix: np.ndarray) -> str:
    return f"{name}: " + " ".join(f"{value:.12e}" for value in matrix.ravel()) + "\n"


def read_calibration(path: str | Path) -> Calibration:
    """Read a calibration file, see `parse_calibration`; with `calib_velo_to_cam.txt` the files of a day of raw drives.

    Raises:
        FormatError: it cannot be read, or lacks a matrix.
    """
    file = Path(path)
    return _read_raw(file.parent) if file.name == VELO_TO_CAM else parse_calibration(read_text(file), file)


def _read_raw(folder: Path) -> Calibration:
    """The calibration of a day of KITTI's raw drives (development kit for raw data, readme.txt)."""
    cameras = _rows(folder / CAM_TO_CAM)
    imu = folder / _IMU_TO_VELO
    lines = {
        "R0_rect": cameras.get("R_rect_00", ""),
        "Tr_velo_to_cam": _rigid(_rows(folder / VELO_TO_CAM)),
        "Tr_imu_to_velo": _rigid(_rows(imu)) if imu.is_file() else "",
        **{f"P{camera}": cameras.get(f"P_rect_{camera:02d}", "") for camera in range(4)},
    }
    return parse_calibration("\n".join(f"{name}: {words}" for name, words in lines.items()), folder)


def _rows(file: Path) -> dict[str, str]:
    pairs = (line.partition(":") for line in read_text(file).splitlines())
    return {key.strip(): words.strip() for key, _, words in pairs}


def _rigid(rows: Mapping[str, str]) -> str:
    """The words of R (3 × 3) and T (3) as those of a 3 × 4 matrix, row by row."""
    turned, moved = rows.get("R", "").split(), rows.get("T", "").split()
    return " ".join(" ".join([*turned[3 * row : 3 * row + 3], *moved[row : row + 1]]) for row in range(3)).strip()


def write_calibration(path: str | Path, calibration: Calibration) -> None:
    """Write a calibration file; see `format_calibration`."""
    Path(path).write_text(format_calibration(calibration), encoding="utf-8", newline="\n")


def _carry(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    xyz = np.asarray(points, np.float64).reshape(-1, np.shape(points)[-1])[:, :3]
    return np.einsum("nj,ij->ni", xyz, matrix[:3, :3]) + matrix[:3, 3]  # no BLAS threads for 3 × 3
