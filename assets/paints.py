"""Paints and fabrics: colours of instances, and their reflectance at 905 nm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assets.materials import Rgb


@dataclass(frozen=True)
class Paint:
    """Colour of one instance; it replaces the defaults of materials marked `paint`.

    Attributes:
        name: the colour's name.
        rgb: visible diffuse colour, linear, 0–1 per channel.
        reflectance: diffuse reflectance at 905 nm, 0–1. Carbon-black pigments stay dark in the near
            infrared, most coloured organic pigments do not, so red and blue have the same reflectance.
    """

    name: str
    rgb: Rgb
    reflectance: float


# Weights follow the share of colours among new cars in Europe, in percent.
_CAR = (
    (28.0, Paint("white", (0.78, 0.78, 0.77), 0.62)),
    (3.0, Paint("pearl", (0.66, 0.65, 0.61), 0.57)),
    (20.0, Paint("black", (0.012, 0.012, 0.014), 0.06)),
    (6.0, Paint("anthracite", (0.045, 0.047, 0.05), 0.12)),
    (14.0, Paint("grey", (0.15, 0.155, 0.16), 0.23)),
    (10.0, Paint("silver", (0.46, 0.47, 0.48), 0.48)),
    (6.0, Paint("blue", (0.02, 0.06, 0.22), 0.30)),
    (3.0, Paint("dark_blue", (0.01, 0.02, 0.07), 0.14)),
    (5.5, Paint("red", (0.38, 0.02, 0.02), 0.44)),
    (1.2, Paint("green", (0.03, 0.11, 0.05), 0.26)),
    (1.3, Paint("brown", (0.12, 0.07, 0.04), 0.28)),
    (1.0, Paint("beige", (0.50, 0.43, 0.32), 0.52)),
    (0.5, Paint("orange", (0.60, 0.18, 0.02), 0.50)),
    (0.5, Paint("yellow", (0.72, 0.50, 0.04), 0.58)),
)
_TRADE = (
    (52.0, Paint("white", (0.78, 0.78, 0.77), 0.62)),
    (12.0, Paint("silver", (0.46, 0.47, 0.48), 0.48)),
    (10.0, Paint("grey", (0.15, 0.155, 0.16), 0.23)),
    (9.0, Paint("blue", (0.02, 0.07, 0.28), 0.32)),
    (6.0, Paint("red", (0.38, 0.02, 0.02), 0.44)),
    (5.0, Paint("yellow", (0.72, 0.50, 0.04), 0.58)),
    (3.0, Paint("green", (0.03, 0.16, 0.06), 0.28)),
    (3.0, Paint("black", (0.012, 0.012, 0.014), 0.06)),
)
_BUS = (
    (35.0, Paint("white", (0.78, 0.78, 0.77), 0.62)),
    (25.0, Paint("traffic_red", (0.45, 0.03, 0.02), 0.46)),
    (25.0, Paint("traffic_yellow", (0.72, 0.50, 0.04), 0.58)),
    (15.0, Paint("city_blue", (0.03, 0.12, 0.34), 0.33)),
)
# Dyes hide little at 905 nm: dark cloth is far brighter there than it looks, black cotton included.
_CLOTHING = (
    (22.0, Paint("black_cloth", (0.02, 0.02, 0.022), 0.22)),
    (18.0, Paint("denim", (0.06, 0.09, 0.18), 0.42)),
    (14.0, Paint("navy", (0.02, 0.03, 0.08), 0.34)),
    (14.0, Paint("grey_cloth", (0.22, 0.22, 0.23), 0.45)),
    (12.0, Paint("white_cloth", (0.72, 0.72, 0.70), 0.70)),
    (7.0, Paint("red_cloth", (0.36, 0.04, 0.04), 0.56)),
    (5.0, Paint("olive", (0.12, 0.13, 0.06), 0.44)),
    (5.0, Paint("beige_cloth", (0.48, 0.40, 0.28), 0.62)),
    (3.0, Paint("yellow_cloth", (0.70, 0.52, 0.08), 0.66)),
)

PAINTS: dict[str, tuple[tuple[float, Paint], ...]] = {
    "car": _CAR,
    "van": _TRADE,
    "truck": _TRADE,
    "bus": _BUS,
    "tram": _BUS,
    "motorcycle": _CAR,
    "cyclist": _CLOTHING,
    "pedestrian": _CLOTHING,
    "person_sitting": _CLOTHING,
}


def draw_paint(kind: str, rng: np.random.Generator) -> Paint:
    """One paint for a road user of `kind`, drawn by popularity; takes one number from `rng`.

    Raises:
        KeyError: no paints are known for this kind.
    """
    if kind not in PAINTS:
        raise KeyError(f"no paints for kind {kind!r}; use one of {', '.join(PAINTS)}")
    weights = np.cumsum([weight for weight, _ in PAINTS[kind]])
    row = int(np.searchsorted(weights, rng.random() * weights[-1], side="right"))
    return PAINTS[kind][row][1]
