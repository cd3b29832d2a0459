"""The pixels of a depth camera as beams, thinned to the resolution of a LiDAR."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field, model_validator

from sensors.pattern import Pattern
from sensors.rays import Rays


class DepthCamera(Pattern):
    """A pinhole depth camera at the LiDAR's place, looking forward; all its pixels see the pose time.

    Of the pixels in each cell of azimuth and elevation only the one nearest to the cell's middle is a beam: the
    others would be thrown away after tracing. A row of cells counts as a ring. `elevation_deg`, the rows' middles,
    and `firings`, the most beams of a row, follow from the rest.
    """

    width_px: int = Field(ge=1, le=8192, description="columns of the depth image")
    height_px: int = Field(ge=1, le=8192, description="rows of the depth image")
    fov_deg: float = Field(gt=0, lt=170, description="horizontal field of view [°]")
    cell_deg: tuple[float, float] = Field(description="width and height of a cell [°]")
    span_deg: tuple[float, float] = Field(description="lowest and highest elevation that is kept [°]")

    @model_validator(mode="before")
    @classmethod
    def _with_rows(cls, values: Any) -> Any:
        if not isinstance(values, dict):
            return values
        try:
            low, high = map(float, values["span_deg"])
            step = float(values["cell_deg"][1])
        except (KeyError, TypeError, ValueError, IndexError):
            return values  # the fields' own checks name the fault
        rows = int(np.ceil((high - low) / step - 1e-9)) if step > 0 else 0
        elevation = tuple(round(high - (row + 0.5) * step, 4) for row in range(min(rows, 257)))
        return {"firings": 1, **values, "elevation_deg": elevation, "block": (), "azimuth_offset_deg": ()}

    @model_validator(mode="after")
    def _of_this_width(self) -> DepthCamera:
        if not (self.cell_deg[0] > 0 and self.cell_deg[1] > 0):
            raise ValueError(f"cell_deg is {list(self.cell_deg)}; give a width and a height above 0")
        object.__setattr__(self, "firings", int(np.ceil(self.fov_deg / self.cell_deg[0])))
        return self

    def rays(self) -> Rays:
        """The chosen pixels in LiDAR axes, row of cells by row of cells from the top, each from left to right."""
        focal = self.width_px / 2 / np.tan(np.radians(self.fov_deg / 2))
        aside = (np.arange(self.width_px) + 0.5 - self.width_px / 2) / focal
        down = (np.arange(self.height_px) + 0.5 - self.height_px / 2) / focal
        y, z = (-grid.ravel() for grid in np.meshgrid(aside, down))
        azimuth, elevation = np.arctan2(y, 1.0), np.arctan2(z, np.hypot(1.0, y))
        across = (self.fov_deg / 2 - np.degrees(azimuth)) / self.cell_deg[0]
        along = (self.span_deg[1] - np.degrees(elevation)) / self.cell_deg[1]
        column, row = np.floor(across).astype(np.int64), np.floor(along).astype(np.int64)
        inside = np.flatnonzero((row >= 0) & (row < self.rings))
        off = (across - column - 0.5) ** 2 + (along - row - 0.5) ** 2
        cell = row * 2**32 + column
        order = inside[np.lexsort((off[inside], cell[inside]))]
        chosen = order[np.diff(cell[order], prepend=-1) != 0]
        direction = np.stack([np.ones(len(chosen)), y[chosen], z[chosen]], 1)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        return Rays(
            origin=np.zeros((len(chosen), 3), np.float32),
            direction=direction.astype(np.float32),
            ring=row[chosen].astype(np.uint8),
            azimuth=azimuth[chosen].astype(np.float32),
            time_s=np.zeros(len(chosen), np.float32),
        )
