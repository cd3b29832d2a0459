"""Colours: perceptual colour maps for measurements, fixed colours for classes and instances; all RGB, uint8."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

Rgb = tuple[int, int, int]
BACKGROUND: Rgb = (13, 16, 22)
GRID: Rgb = (38, 45, 57)
MUTED: Rgb = (134, 146, 166)
TEXT: Rgb = (226, 232, 240)

CLASS_COLOURS: dict[str, Rgb] = {
    "car": (255, 178, 62),
    "van": (255, 122, 69),
    "truck": (240, 82, 82),
    "bus": (214, 92, 173),
    "tram": (190, 120, 255),
    "pedestrian": (255, 110, 199),
    "person_sitting": (255, 150, 215),
    "cyclist": (86, 204, 242),
    "motorcycle": (120, 180, 255),
}
OTHER_CLASS: Rgb = (190, 200, 215)
_ROUND_VALUES = (1, 2, 3, 5, 10, 20, 40, 80, 160)
_GOLDEN = 0.61803398875  # successive hues lie as far apart as can be
_MAPS = {"turbo": cv2.COLORMAP_TURBO, "viridis": cv2.COLORMAP_VIRIDIS}


@dataclass(frozen=True)
class Scale:
    """Colour scale of a measured value.

    Attributes:
        name: quantity with its unit; ASCII, because it is drawn into images.
        low: value at the lower end; smaller values have the same colour.
        high: value at the upper end; larger values have the same colour.
        map: colour map: `turbo` for distances, `viridis` for intensities.
        start: share of the dark end of the map that is not used, so that low values are visible on black.
        near_is_warm: reverse the map.
        logarithmic: use a logarithmic scale; requires `low` > 0.
    """

    name: str
    low: float
    high: float
    map: Literal["turbo", "viridis"] = "turbo"
    start: float = 0.0
    near_is_warm: bool = False
    logarithmic: bool = False

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Colours of values of any shape: that shape + (3,) uint8."""
        share = self.share(values)
        if self.near_is_warm:
            share = 1 - share
        index = np.rint(255 * (self.start + (1 - self.start) * share)).astype(np.uint8)
        table = cv2.applyColorMap(np.arange(256, dtype=np.uint8).reshape(-1, 1), _MAPS[self.map])
        return table[:, 0, ::-1][index]

    def value(self, share: float) -> float:
        """The value at a share 0–1 of the way from `low` to `high`."""
        if self.logarithmic:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)

    @property
    def ticks(self) -> list[float]:
        """Values to mark: five equally spaced, or round ones on a logarithmic scale."""
        if self.logarithmic:
            return [tick for tick in _ROUND_VALUES if self.low <= tick <= self.high]
        return [self.value(share) for share in (0, 0.25, 0.5, 0.75, 1)]

    def share(self, values: np.ndarray) -> np.ndarray:
        """Scale values from `low`–`high` to 0–1, clipped."""
        values = np.clip(np.asarray(values, np.float32), self.low, self.high)
        if self.logarithmic:
            return np.log(values / self.low) / np.log(self.high / self.low)
        return (values - self.low) / (self.high - self.low)


def dimmed(colour: Rgb, share: float) -> Rgb:
    """Scale the brightness of a colour."""
    red, green, blue = colour
    return int(red * share), int(green * share), int(blue * share)


def class_colour(name: str) -> Rgb:
    """Colour of a class or kind of object; case-insensitive."""
    return CLASS_COLOURS.get(name.lower(), OTHER_CLASS)


def instance_colours(numbers: np.ndarray) -> np.ndarray:
    """Vivid colours (n, 3) uint8 of instance numbers (n,) from 0; consecutive numbers have very different hues."""
    numbers = np.asarray(numbers, np.int64)
    hue = (numbers * _GOLDEN) % 1 * 179
    saturation = np.where(numbers % 3 == 1, 105, 170)
    hsv = np.stack([hue, saturation, np.full(len(numbers), 255)], -1).astype(np.uint8)
    return cv2.cvtColor(hsv.reshape(1, -1, 3), cv2.COLOR_HSV2RGB)[0] if len(numbers) else np.zeros((0, 3), np.uint8)


def colour_by_instance(numbers: np.ndarray, brightness: np.ndarray) -> np.ndarray:
    """Colours (n, 3) uint8 of points: one hue per object, gray for the static world (−1).

    Args:
        numbers: (n,) instance numbers.
        brightness: (n,) 0–1, for example the intensity; makes surfaces of one object distinguishable.
    """
    brightness = np.clip(brightness, 0, 1)[:, None]
    colours = np.repeat(72 + 118 * brightness, 3, axis=1)
    moving = numbers >= 0
    colours[moving] = instance_colours(numbers[moving]) * (0.55 + 0.45 * brightness[moving])
    return colours.astype(np.uint8)
