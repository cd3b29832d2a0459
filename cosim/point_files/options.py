"""Options that state the meaning of point files where the numbers do not show it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosim.point_files.scan import PointFileError

#: Meanings that a column may have; `_` is an unused column.
ROLES = ("x", "y", "z", "intensity", "ring", "time", "_")


@dataclass(frozen=True)
class PointOptions:
    """Statements of the user; None leaves the question to the inference.

    Attributes:
        columns: meaning of each column in the order of the file, as `x,y,z,intensity,_`.
        intensity_scale: reading of full intensity, as 255.
        axes: which stored axes are x forward, y left and z up, as `x,-y,z`. Stating it ends the check of the axes.
        flip_y: whether stored y points to the right; short for `axes: x,-y,z`.
        metres: length of one unit of x, y, z [m].
    """

    columns: str | None = None
    intensity_scale: float | None = None
    axes: str | None = None
    flip_y: bool = False
    metres: float | None = None

    def __post_init__(self) -> None:
        scale = self.intensity_scale
        if scale is not None and not (np.isfinite(scale) and scale > 0):
            raise PointFileError(
                f"--intensity-scale is {scale:g}; give the stored value of full intensity, for example 255"
            )
        if self.metres is not None and not (np.isfinite(self.metres) and self.metres > 0):
            raise PointFileError(f"--metres is {self.metres:g}; give the length of one unit of x, y, z, as 0.001")
        if self.axes is not None and self.flip_y:
            raise PointFileError("--axes and --flip-y both say what y is; give one of them")
        self.roles  # noqa: B018 - raises
        self.axes_matrix  # noqa: B018 - raises

    @property
    def roles(self) -> tuple[str, ...] | None:
        """Meaning of each column; None where it is not stated.

        Raises:
            PointFileError: an unknown meaning, one given twice, or no x, y and z.
        """
        if self.columns is None:
            return None
        named = tuple(word.strip().lower() for word in self.columns.split(","))
        named = tuple("intensity" if word == "i" else "time" if word == "t" else word for word in named)
        used = [word for word in named if word != "_"]
        if set(used) - set(ROLES) or len(used) != len(set(used)) or not {"x", "y", "z"} <= set(used):
            raise PointFileError(
                f"--columns is {self.columns!r}; give one word a column of {', '.join(ROLES)}, each but _ once, "
                "as x,y,z,intensity,_"
            )
        return named

    @property
    def axes_matrix(self) -> np.ndarray | None:
        """(3, 3) signed permutation from stored to x forward, y left, z up; None where it is not stated.

        Raises:
            PointFileError: not three different axes.
        """
        stated = "x,-y,z" if self.flip_y else self.axes
        if stated is None:
            return None
        words = [word.strip().lower() for word in stated.split(",")]
        letters = [word.lstrip("+-") for word in words]
        if sorted(letters) != ["x", "y", "z"]:
            raise PointFileError(f"--axes is {stated!r}; name each of x, y and z once, as x,-y,z or y,-x,z")
        matrix = np.zeros((3, 3))
        for row, (word, letter) in enumerate(zip(words, letters, strict=True)):
            matrix[row, "xyz".index(letter)] = -1.0 if word.startswith("-") else 1.0
        return matrix
