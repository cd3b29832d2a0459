"""Beam patterns: which way every laser looks and when it fires."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from assets.documents import DocumentError, parse_yaml
from sensors.errors import SensorError
from sensors.rays import Rays

_FOLDER = files("sensors") / "patterns"


class Pattern(BaseModel):
    """A spinning multi-beam scanner with one optical centre.

    Rays come ring-major: ring 0 (top) first, its firings in order. Step k of a revolution is at column
    azimuth π − 2π(k + 0.5)/firings, so the head turns clockwise seen from above, and fires at
    time −column/2π · sweep_s from the pose time, when the head faces forward; lasers that fire one after the
    other within a step do so later by their `firing_offset_us`. An encoder reports columns in whole ticks.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(description="name of the pattern")
    sweep_s: float = Field(gt=0, le=10, description="duration of one revolution [s]")
    firings: int = Field(ge=1, le=36000, description="azimuth steps a revolution")
    range_m: tuple[float, float] = Field(description="nearest and farthest measurable range [m]")
    elevation_deg: tuple[float, ...] = Field(min_length=1, max_length=256, description="one a laser, top first [°]")
    azimuth_offset_deg: tuple[float, ...] = Field(
        default=(), description="sideways fan of each laser, positive counter-clockwise [°]; empty: none"
    )
    block: tuple[int, ...] = Field(
        default=(), description="optical block of each laser: 0 upper, 1 lower; empty: all 0"
    )
    firing_offset_us: tuple[float, ...] = Field(
        default=(), description="how much later than its column each laser fires [µs]; empty: all at once"
    )

    encoder_deg: float = Field(
        default=0.0, ge=0, le=10, description="tick of the encoder, to whose multiples columns are rounded [°]; 0: none"
    )
    coordinate_step_m: float = Field(
        default=0.0, ge=0, le=1, description="grid on which coordinates of points are reported [m]; 0: none"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Pattern:
        rings = len(self.elevation_deg)
        for name in ("azimuth_offset_deg", "block"):
            values = getattr(self, name)
            if not values:
                object.__setattr__(self, name, (0,) * rings)
            elif len(values) != rings:
                raise ValueError(f"{name} has {len(values)} entries but elevation_deg has {rings}; give one a laser")
        beyond = [elevation for elevation in self.elevation_deg if not -90 < elevation < 90]
        if beyond:
            raise ValueError(f"elevation_deg holds {beyond[0]:g}; give degrees between -90 and 90")
        if any(block not in (0, 1) for block in self.block):
            raise ValueError("block entries are 0 (upper) or 1 (lower)")
        if self.firing_offset_us and len(self.firing_offset_us) != rings:
            raise ValueError(
                f"firing_offset_us has {len(self.firing_offset_us)} entries but elevation_deg has {rings}; "
                "give one a laser or none"
            )
        low, high = self.range_m
        if not 0 <= low < high <= 1000:
            raise ValueError(f"range_m is [{low}, {high}]; give 0 <= nearest < farthest <= 1000")
        return self

    @property
    def rings(self) -> int:
        """Number of lasers."""
        return len(self.elevation_deg)

    def rays(self) -> Rays:
        """All beams of one revolution in LiDAR axes (x forward, y left, z up)."""
        column = np.pi - 2 * np.pi * (np.arange(self.firings) + 0.5) / self.firings
        if self.encoder_deg:
            tick = np.radians(self.encoder_deg)
            column = np.rint(column / tick) * tick
        elevation = np.radians(np.array(self.elevation_deg))[:, None]
        azimuth = column[None, :] + np.radians(np.array(self.azimuth_offset_deg, float))[:, None]
        azimuth = np.pi - np.mod(np.pi - azimuth, 2 * np.pi)
        direction = np.stack(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.broadcast_to(np.sin(elevation), azimuth.shape),
            ],
            axis=-1,
        )
        ring = np.repeat(np.arange(self.rings, dtype=np.uint8), self.firings)
        later_s = 1e-6 * np.array(self.firing_offset_us or (0.0,) * self.rings)[:, None]
        time_s = np.broadcast_to(-column / (2 * np.pi) * self.sweep_s + later_s, azimuth.shape)
        return Rays(
            origin=np.zeros((ring.size, 3), np.float32),
            direction=direction.reshape(-1, 3).astype(np.float32),
            ring=ring,
            azimuth=azimuth.reshape(-1).astype(np.float32),
            time_s=time_s.reshape(-1).astype(np.float32),
        )

    def to_yaml(self) -> str:
        """The pattern in its file format."""
        values = self.model_dump(mode="json")
        for optional in ("firing_offset_us", "encoder_deg", "coordinate_step_m"):
            if not values[optional]:
                del values[optional]
        return yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=110)


def pattern_names() -> list[str]:
    """Names of the built-in patterns."""
    return sorted(item.name.removesuffix(".yaml") for item in _FOLDER.iterdir() if item.name.endswith(".yaml"))


def load_pattern(name_or_path: str | Path) -> Pattern:
    """Read a built-in pattern by name or any pattern file by path.

    Raises:
        SensorError: no such pattern, or the file breaks the format.
    """
    text = str(name_or_path)
    if text in pattern_names():
        source = _FOLDER / f"{text}.yaml"
    else:
        source = Path(text)
        if not source.is_file():
            raise SensorError(
                f"pattern {text!r} does not exist; choose one of {', '.join(pattern_names())} or give a file's path"
            )
    try:
        content = source.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SensorError(f"pattern {text} cannot be read: {' '.join(str(error).split())}") from error
    return parse_pattern(content, origin=text)


def parse_pattern(text: str, *, origin: str) -> Pattern:
    """A pattern from its YAML text; `origin` names it in errors.

    Raises:
        SensorError: the text breaks the format.
    """
    from sensors.depth_camera import DepthCamera  # both are Patterns themselves
    from sensors.direction_table import DirectionTable, is_tabulated, tabulated

    folder = Path(origin).parent if Path(origin).is_file() else None
    try:
        values = parse_yaml(text)
        if isinstance(values, dict) and is_tabulated(values):
            return DirectionTable.model_validate(_said(tabulated, values, folder, origin))
        kind = DepthCamera if isinstance(values, dict) and "fov_deg" in values else Pattern
        return kind.model_validate(values)
    except DocumentError as error:
        raise SensorError(f"pattern {origin} is not YAML: {' '.join(str(error).split())}") from error
    except ValidationError as error:
        raise SensorError(f"pattern {origin}: {first_problem(error)}") from error


def _said(make: Callable[..., dict[str, Any]], values: dict[str, Any], folder: Path | None, origin: str) -> Any:
    """Call, with what goes wrong said as the pattern's fault."""
    try:
        return make(values, folder)
    except ValueError as error:
        raise SensorError(f"pattern {origin}: {error}") from error


def first_problem(error: ValidationError) -> str:
    """One line for the first fault pydantic found: where, what was given, what is wrong."""
    problem = error.errors()[0]
    where = ".".join(str(part) for part in problem["loc"])
    message = problem["msg"].removeprefix("Value error, ")
    if problem["type"] == "extra_forbidden":
        return f"unknown key {where!r}; remove it or correct its spelling"
    given = repr(problem["input"])
    shown = given if len(given) <= 60 else given[:57] + "..."
    return f"{where}: {message} (got {shown})" if where else message
