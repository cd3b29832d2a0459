"""The page of a recording's twin: the map from above, its thickness, the path, what was left out and why."""

from __future__ import annotations

import cv2
import numpy as np
from markupsafe import Markup

from cosim.recordings.mapping.twin import RecordingTwin
from cosim.report import document, facts, figure, legend, notes_section, section, table
from cosim.report.html import fill
from cosim.report.plot import Axis, Plot, nice_top

_PIXELS = 900
_THICK_M = 0.03
_GROUND, _WALL, _MOVING, _PATH, _HELD = (110, 100, 90), (255, 169, 90), (106, 96, 240), (62, 178, 255), (140, 208, 111)


def format_page(twin: RecordingTwin) -> str:
    """The HTML text."""
    result = twin.as_json()
    held = result["error_held_out_m"]
    verdict = (
        f"{result['scans']} scans over {result['path_m']:.0f} m make a map of {result['surfels']:,} surfaces, "
        f"{1000 * result['thickness_ground_m']:.1f} mm thick on the ground and "
        f"{1000 * result['thickness_walls_m']:.1f} mm on walls"
        + (f"; scans that took no part lie on it within {1000 * held:.1f} mm." if held else ".")
    )
    charts = Markup().join(
        (_above(twin), _thick(twin), _by_scans(twin), _sweep(twin), _path_errors(twin), _rounds(twin))
    )
    return document(
        f"Twin of {twin.recording.name}",
        [
            fill(
                "<header><h1>Twin of a recording: {}</h1><p class='verdict'>{}</p>{}</header>",
                twin.recording.name,
                verdict,
                _facts(result, twin),
            ),
            section("The map", fill('<div class="charts">{}</div>', charts)),
            _left_out(twin, result),
            notes_section(twin.notes, "What to know"),
        ],
        generator="cosim twin",
    )


def _facts(result: dict, twin: RecordingTwin) -> str:
    return facts(
        [
            ("Poses", result["poses"]),
            ("Lasers", f"{result['lasers']}"),
            ("Height of the sensor", f"{result['mount']['height_m']:.2f} m"),
            ("Points on the map", f"{result['points_on_map_share']:.0%}"),
            ("Scans that took no part", f"{len(twin.made.held_out)}"),
            ("Error of the others", f"{1000 * result['error_fitted_m']:.1f} mm"),
        ]
    )


def _left_out(twin: RecordingTwin, result: dict) -> str:
    rows = [
        [
            "cells that are no plane",
            f"{result['cells_without_plane']:,}",
            "an edge, a bush, two surfaces, or too few scans",
        ],
        [
            "surfaces of what moves",
            f"{result['surfels_moving']:,}",
            "beams passed through in several scans, or none came back",
        ],
        ["scans held out", f"{len(twin.made.held_out)}", "placed on the map by their own pose only"],
    ]
    if twin.made.refused:
        blank = np.count_nonzero(~twin.made.mapped)
        rows.append(["segments without a map", f"{blank}", twin.made.refused[0].partition(": ")[2]])
    return section("Left out", table(["", "how many", "why"], rows, words=(2,)))


def _view(twin: RecordingTwin) -> tuple[np.ndarray, float]:
    """Lower corner (2,) of the square that is shown, and its side [m]."""
    path = twin.made.path[:, :2, 3]
    low, high = path.min(0) - 40, path.max(0) + 40
    side = float((high - low).max())
    return (low + high) / 2 - side / 2, side


def _painted(twin: RecordingTwin, thick: bool) -> str:
    corner, side = _view(twin)
    image = np.full((_PIXELS, _PIXELS, 3), (22, 13, 11), np.uint8)
    made = twin.made
    size = max(1, round(0.4 / side * _PIXELS))

    def pixels(xy: np.ndarray) -> np.ndarray:
        at = (xy - corner) / side * _PIXELS
        return np.stack([at[:, 0], _PIXELS - at[:, 1]], 1).astype(int)

    def dots(xy: np.ndarray, colours: np.ndarray) -> None:
        """Squares of some colours (n, 3), the later above."""
        at = pixels(xy)
        for right in range(size + 1):
            for down in range(size + 1):
                x, y = at[:, 0] + right, at[:, 1] + down
                inside = (x >= 0) & (y >= 0) & (x < _PIXELS) & (y < _PIXELS)
                image[y[inside], x[inside]] = colours[inside]

    order = np.argsort(made.centre[:, 2], kind="stable")
    share = np.clip(made.sd_m / _THICK_M, 0, 1)
    ramp = cv2.applyColorMap((255 * share).astype(np.uint8).reshape(-1, 1), cv2.COLORMAP_VIRIDIS).reshape(-1, 3)
    plain = np.where(made.ground[:, None], np.array(_GROUND), np.array(_WALL)).astype(np.uint8)
    dots(made.centre[order, :2], (ramp if thick else plain)[order])
    if not thick:
        dots(made.left_out[:, :2], np.tile(np.array(_MOVING, np.uint8), (len(made.left_out), 1)))
    path = pixels(made.path[:, :2, 3])
    cv2.polylines(image, [path.reshape(-1, 1, 2).astype(np.int32)], False, _PATH, 2, cv2.LINE_AA)
    for part in np.split(np.array(made.held_out, int), np.flatnonzero(np.diff(made.held_out) > 1) + 1):
        cv2.polylines(image, [path[part].reshape(-1, 1, 2).astype(np.int32)], False, _HELD, 3, cv2.LINE_AA)
    plot = Plot(
        Axis(corner[0], corner[0] + side, "x [m]"),
        Axis(corner[1], corner[1] + side, "y [m]"),
        "map from above",
        620,
        620,
    )
    plot.picture(cv2.imencode(".png", image)[1].tobytes(), corner[0], corner[0] + side, corner[1], corner[1] + side)
    return plot.svg()


def _css(colour: tuple[int, int, int]) -> str:
    return f"rgb({colour[2]},{colour[1]},{colour[0]})"


def _above(twin: RecordingTwin) -> str:
    words = [
        (_css(_GROUND), "ground"),
        (_css(_WALL), "other surfaces"),
        (_css(_MOVING), "moving, left out"),
        (_css(_PATH), "path"),
        (_css(_HELD), "scans held out"),
    ]
    return figure("From above", "every surface of the map", _painted(twin, False) + legend(words))


def _thick(twin: RecordingTwin) -> str:
    ends = [("#440154", "0 mm"), ("#fde725", f"{1000 * _THICK_M:.0f} mm and more")]
    return figure("Thickness by place", "spread of points across each surface", _painted(twin, True) + legend(ends))


def _by_scans(twin: RecordingTwin) -> str:
    made = twin.made
    edges = np.unique(np.round(np.geomspace(3, max(int(made.scans.max()), 4) + 1, 9)).astype(int))
    middle = np.sqrt(edges[:-1] * (edges[1:] - 1))
    lines = []
    for rows in (made.level, ~made.level):
        slot = np.digitize(made.scans, edges) - 1
        parts = [made.sd_m[rows & (slot == number)] for number in range(len(middle))]
        lines.append(np.array([1000 * np.median(part) if len(part) > 5 else np.nan for part in parts]))
    top = nice_top(float(np.nanmax(np.concatenate([*lines, [1.0]]))))
    plot = Plot(
        Axis(0, float(edges[-1]), "scans that saw a surface"), Axis(0, top, "thickness [mm]"), "thickness by scans"
    )
    plot.line(middle, lines[0], "a", dots=True)
    plot.line(middle, lines[1], "b", dots=True)
    return figure("Thickness by number of scans", "flat surfaces (yellow), all others (blue)", plot.svg())


def _sweep(twin: RecordingTwin) -> str:
    if twin.sweep is None:
        return ""
    sweep = twin.sweep
    windows = np.sort(sweep.windows)
    low, high = min(-0.2, float(windows.min()) - 0.1), max(1.2, float(windows.max()) + 0.1)
    names = ["", *(f"stretch {number + 1}" for number in range(len(windows)))]
    plot = Plot(Axis(0.5, len(windows) + 0.5, "", names=names), Axis(low, high, "strength"), "motion within a sweep")
    for value, style in ((sweep.strength, "b"), (sweep.low, "c"), (sweep.high, "c")):
        if low <= value <= high:
            plot.line(np.array([0.5, len(windows) + 0.5]), np.full(2, value), style)
    plot.line(np.arange(1, len(windows) + 1), windows, "a", dots=True)
    return figure(
        f"Motion-compensated: {sweep.is_compensated}",
        f"Strength of the sensor's motion in the points by stretch (yellow), mean (blue) and 95 % interval (green): "
        f"{sweep.evidence}.",
        plot.svg(),
    )


def _path_errors(twin: RecordingTwin) -> str:
    error = 1000 * twin.made.error_m
    plot = Plot(Axis(0, len(error), "scan"), Axis(0, nice_top(float(np.nanmax(error))), "error [mm]"), "error by scan")
    plot.line(np.arange(len(error)), error, "b")
    held = np.full(len(error), np.nan)
    held[list(twin.made.held_out)] = error[list(twin.made.held_out)]
    plot.line(np.arange(len(error)), held, "c")
    return figure(
        "Error by scan", "spread of its points across the map's surfaces; green: took no part in the map", plot.svg()
    )


def _rounds(twin: RecordingTwin) -> str:
    ground, walls = 1000 * twin.made.rounds.T
    plot = Plot(
        Axis(-0.2, len(ground) - 0.8, "round"),
        Axis(0, nice_top(float(np.nanmax([ground, walls]))), "thickness [mm]"),
        "rounds",
    )
    plot.line(np.arange(len(ground)), ground, "a", dots=True)
    plot.line(np.arange(len(walls)), walls, "b", dots=True)
    return figure(
        "Poses refined",
        "flat surfaces (yellow), others (blue); the last round has its cells along the level",
        plot.svg(),
    )
