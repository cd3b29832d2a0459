"""Architecture of a detector: presets by name, and their keys."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from training.data.grid import Grid

_CELLS_IN_TESTS = 40000

Name = Literal["pillars_small", "pointpillars", "voxel_rcnn"]


class ModelSettings(BaseModel):
    """A detector. Keys that are not given take the values of the preset `name`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: Name = Field(default="pillars_small", description="pillars_small, pointpillars or voxel_rcnn")
    low_m: tuple[float, float, float] = Field(default=(0.0, -25.6, -3.0), description="corner of the range [m]")
    high_m: tuple[float, float, float] = Field(default=(51.2, 25.6, 1.0), description="opposite corner [m]")
    cell_m: tuple[float, float, float] = Field(default=(0.2, 0.2, 4.0), description="size of a pillar or voxel [m]")
    max_points: int | None = Field(
        default=None, ge=1, description="maximum number of points per pillar; none: no limit"
    )
    max_cells: int | None = Field(
        default=None, ge=1, description="maximum number of pillars or voxels per frame, in training"
    )
    pillar_channels: int = Field(default=32, ge=1, description="features of a pillar")
    layers: tuple[int, ...] = Field(default=(2, 3, 3), description="additional convolutions of each 2-D stage")
    strides: tuple[int, ...] = Field(default=(2, 2, 2), description="stride of each stage")
    channels: tuple[int, ...] = Field(default=(32, 64, 128), description="features of each stage")
    upsample: tuple[int, ...] = Field(default=(1, 2, 4), description="upsampling factor of each stage")
    upsample_channels: tuple[int, ...] = Field(default=(48, 48, 48), description="features of each upsampled stage")
    direction_offset_rad: float = Field(
        default=0.78539, description="heading at which the first half-turn starts [rad]"
    )
    level_ground: bool = Field(
        default=False, description="measure heights above the local ground, which is estimated from the points"
    )
    intensity: bool = Field(default=True, description="use intensities, whose meaning depends on the make of the LiDAR")
    refine: bool = Field(
        default=False, description="add a second stage that corrects each box from the points in and around it"
    )
    norm_momentum: float = Field(default=0.1, gt=0, le=1, description="of batch normalisation's running statistics")
    sparse_channels: tuple[int, int, int, int, int] = Field(
        default=(16, 32, 64, 64, 128), description="features of the sparse stages of voxel_rcnn"
    )
    roi_grid: int = Field(default=6, ge=2, le=12, description="points along each side of a region of interest")
    roi_channels: int = Field(default=256, ge=8, description="width of the second stage")
    roi_count: int = Field(default=128, ge=8, description="training regions of the second stage per frame")
    roi_points: int = Field(default=128, ge=8, description="maximum number of points per region")
    roi_neighbours: int = Field(default=4, ge=1, le=6, description="search radius around a region's point [voxels]")
    dropout: float = Field(default=0.3, ge=0, lt=1, description="of the second stage")

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, given: Any) -> Any:
        if isinstance(given, str):
            given = {"name": given}
        preset = PRESETS.get(given.get("name", "pillars_small"), {}) if isinstance(given, dict) else {}
        return {**preset, **given} if isinstance(given, dict) else given

    @model_validator(mode="after")
    def _consistent(self) -> ModelSettings:
        stages = {len(getattr(self, name)) for name in ("layers", "strides", "channels", "upsample")}
        if len(stages | {len(self.upsample_channels)}) != 1:
            raise ValueError(
                "layers, strides, channels, upsample, upsample_channels must each have one entry per stage"
            )
        coarse = 1
        for stride, up in zip(self.strides, self.upsample, strict=True):
            coarse *= stride
            if coarse // up * up != coarse or coarse // up != self.out_stride:
                raise ValueError("each stage's upsample must bring it to the grid of the first refined stage")
        nx, ny, _ = self.grid.cells
        whole = coarse * self.sparse_stride
        if nx % whole or ny % whole:
            raise ValueError(f"the grid has {nx} × {ny} cells; give a range whose cells are a multiple of {whole}")
        return self

    @property
    def grid(self) -> Grid:
        """The pillars or voxels."""
        return Grid(self.low_m, self.high_m, self.cell_m)

    def most_cells(self, training: bool) -> int | None:
        """Maximum number of cells per frame; larger in tests than in training."""
        return self.max_cells if training or self.max_cells is None else max(self.max_cells, _CELLS_IN_TESTS)

    @property
    def sparse_stride(self) -> int:
        """Stride of the sparse stages before the 2-D stages."""
        return 8 if self.name == "voxel_rcnn" else 1

    @property
    def out_stride(self) -> int:
        """Stride of the output grid relative to the input grid of the 2-D stages."""
        return self.strides[0] // self.upsample[0]


PRESETS: dict[str, dict[str, Any]] = {
    "pillars_small": {
        "level_ground": True,
        "intensity": False,
        "refine": True,
        "roi_channels": 128,
        "roi_count": 32,
        "dropout": 0.0,
    },
    "pointpillars": {  # Lang et al., CVPR 2019, as configured for KITTI's three classes in OpenPCDet
        "low_m": (0.0, -39.68, -3.0),
        "high_m": (69.12, 39.68, 1.0),
        "cell_m": (0.16, 0.16, 4.0),
        "max_points": 32,
        "max_cells": 16000,
        "pillar_channels": 64,
        "layers": (3, 5, 5),
        "channels": (64, 128, 256),
        "upsample_channels": (128, 128, 128),
        "norm_momentum": 0.01,
    },
    "voxel_rcnn": {  # Deng et al., AAAI 2021
        "low_m": (0.0, -40.0, -3.0),
        "high_m": (70.4, 40.0, 1.0),
        "cell_m": (0.05, 0.05, 0.1),
        "max_points": 5,
        "max_cells": 16000,
        "layers": (5, 5),
        "strides": (1, 2),
        "channels": (64, 128),
        "upsample": (1, 2),
        "upsample_channels": (128, 128),
        "norm_momentum": 0.01,
    },
}
