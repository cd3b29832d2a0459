"""A town from above as SVG."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape

import cv2
import numpy as np
import shapely
from markupsafe import Markup
from scipy.interpolate import RBFInterpolator

from assets.streets import StreetLane, Streets

_MARGIN_M = 25.0
_SIMPLER_M = 0.15
_SCALE_BAR_M = 100.0
_FAST_KMH, _MAIN_KMH = 70, 45

COLOURS = {
    "local street, up to 40 km/h": "#8a8d93",
    "main street, 45–65 km/h": "#5d6a80",
    "fast road, 70 km/h and more": "#3a4a6b",
    "junction": "#9a9da3",
    "sidewalk": "#d9cdb8",
    "cycle lane": "#b0685a",
    "crossing": "#ffffff",
    "parking": "#7fa7d1",
    "traffic light": "#d33b2c",
    "stop sign": "#7a1f6b",
    "gives way": "#e0a100",
}
_SIGN_COLOURS = {"signal": "traffic light", "stop": "stop sign", "yield": "gives way"}
_CELLS = 72
_MOST_SAMPLES = 1500
_LOW_RGB, _HIGH_RGB = np.array([196, 218, 190]), np.array([238, 222, 188])
_STEEP = 12.0  # exaggerates slopes for the shade


def town_svg(streets: Streets) -> Markup:
    """Return a drawing, north up, one unit a metre."""
    points = np.concatenate([lane.centre[:, :2] for lane in streets.lanes])
    low, high = points.min(axis=0) - _MARGIN_M, points.max(axis=0) + _MARGIN_M
    width, tall = high - low
    frame = f'viewBox="{low[0]:.0f} {-high[1]:.0f} {width:.0f} {tall:.0f}"'
    box = f'x="{low[0]:.1f}" y="{-high[1]:.1f}" width="{width:.1f}" height="{tall:.1f}"'
    relief = _relief_picture(streets, low, high)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {frame} role="img" aria-label="{escape(streets.name)} from above">',
        f'<image {box} preserveAspectRatio="none" href="{relief}"/>',
        *_areas(streets),
        *_lanes(streets),
        _parking(streets),
        _crossings(streets),
        *_signs(streets),
        _scale_bar(low),
        "</svg>",
    ]
    return Markup("\n".join(part for part in parts if part))


def _areas(streets: Streets) -> list[str]:
    uses = (("walkingarea", "sidewalk"), ("junction", "junction"))
    outlines = {use: [area.outline for area in streets.areas if area.use == use] for use, _ in uses}
    return [
        f'<path d="{"".join(_path(o, closed=True) for o in outlines[use])}" fill="{COLOURS[name]}"/>'
        for use, name in uses
    ]


def _lanes(streets: Streets) -> list[str]:
    groups: dict[tuple[str, float], list[StreetLane]] = {}
    for lane in streets.lanes:
        if lane.use != "crossing" and not (lane.internal and lane.use == "drive"):
            groups.setdefault((_class_of(lane), lane.width_m), []).append(lane)
    order = list(COLOURS)
    order.insert(0, order.pop(order.index("sidewalk")))
    return [
        f'<path d="{"".join(_path(lane.centre) for lane in lanes)}" fill="none" '
        f'stroke="{COLOURS[name]}" stroke-width="{width + 0.2:.1f}"/>'
        for (name, width), lanes in sorted(groups.items(), key=lambda item: (order.index(item[0][0]), item[0][1]))
    ]


def _class_of(lane: StreetLane) -> str:
    if lane.use == "sidewalk":
        return "sidewalk"
    if lane.use == "cycle":
        return "cycle lane"
    local, main, fast = list(COLOURS)[:3]
    limit = lane.speed_mps * 3.6
    return fast if limit >= _FAST_KMH else main if limit >= _MAIN_KMH else local


def _parking(streets: Streets) -> str:
    if not streets.parking:
        return ""
    path = "".join(_path(bay.centre) for bay in streets.parking)
    width = float(np.median([bay.width_m for bay in streets.parking])) - 0.3
    return f'<path d="{path}" fill="none" stroke="{COLOURS["parking"]}" stroke-width="{width:.1f}"/>'


def _crossings(streets: Streets) -> str:
    path = "".join(_path(lane.centre) for lane in streets.lanes if lane.use == "crossing")
    stripes = 'stroke-width="3" stroke-dasharray="0.7 0.7"'
    return f'<path d="{path}" fill="none" stroke="{COLOURS["crossing"]}" {stripes}/>'


def _signs(streets: Streets) -> list[str]:
    return [
        f'<circle cx="{line.position[0]:.1f}" cy="{-line.position[1]:.1f}" r="2.2" '
        f'fill="{COLOURS[_SIGN_COLOURS[line.control]]}" stroke="#fff" stroke-width="0.5"/>'
        for line in streets.stop_lines
    ]


def _scale_bar(low: np.ndarray) -> str:
    x, y = low[0] + 12, -low[1] - 10
    bar = f'<path d="M{x:.0f} {y:.0f}h{_SCALE_BAR_M:.0f}" stroke="#222" stroke-width="3"/>'
    return f'{bar}<text x="{x:.0f}" y="{y - 5:.0f}" font-size="15" fill="#222">{_SCALE_BAR_M:.0f} m</text>'


def _path(line: np.ndarray, closed: bool = False) -> str:
    xy = shapely.get_coordinates(shapely.simplify(shapely.LineString(line[:, :2]), _SIMPLER_M))
    return "M" + "L".join(_pairs(xy)) + ("Z" if closed else "")


def _pairs(xy: np.ndarray) -> Iterable[str]:
    return (f"{x:.1f} {-y:.1f}" for x, y in xy)


def _relief_picture(streets: Streets, low: np.ndarray, high: np.ndarray) -> str:
    """Return a `data:` URL of a PNG over the rectangle from `low` to `high` (2,), north up, lit from the north-west."""
    height = _heights(streets, low, high)
    cell = (high - low) / (_CELLS - 1)
    east, north = np.gradient(height, cell[0], cell[1])
    shade = np.clip(1.0 + _STEEP * (east - north) / np.sqrt(2) * 0.5, 0.72, 1.12)[..., None]
    share = ((height - height.min()) / max(np.ptp(height), 8.0))[..., None]
    rgb = np.clip((_LOW_RGB + share * (_HIGH_RGB - _LOW_RGB)) * shade, 0, 255).astype(np.uint8)
    picture = np.ascontiguousarray(rgb.transpose(1, 0, 2)[::-1, :, ::-1])
    _, data = cv2.imencode(".png", picture)
    return f"data:image/png;base64,{base64.b64encode(data.tobytes()).decode()}"


def _heights(streets: Streets, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the ground's height in metres on a grid over a rectangle, first axis east, second north."""
    points = np.concatenate([lane.centre for lane in streets.lanes])
    points = points[:: max(1, len(points) // _MOST_SAMPLES)]
    surface = RBFInterpolator(points[:, :2], points[:, 2], neighbors=48, smoothing=1.0, kernel="linear")
    x, y = (np.linspace(low[k], high[k], _CELLS) for k in (0, 1))
    grid = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    return surface(grid).reshape(_CELLS, _CELLS)
