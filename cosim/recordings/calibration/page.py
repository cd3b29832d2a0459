"""The page of a calibration: findings by round, changes of map and error, what is not determined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cosim.discrepancy.quantities import dependence_words
from cosim.discrepancy.report.unexplained_section import size_words
from cosim.discrepancy.unexplained import Unexplained
from cosim.discrepancy.words import UNDETERMINED, Vocabulary, unexplained_words
from cosim.recordings.calibration.estimates import estimates_of
from cosim.recordings.calibration.loop import SensorCalibration
from cosim.recordings.calibration.rounds import Round
from cosim.report import document, facts, figure, notes_section, section, table
from cosim.report.html import fill
from cosim.report.phrases import p_cell
from cosim.report.plot import Axis, Plot, nice_top


def headline(calibration: SensorCalibration) -> str:
    """The outcome in a sentence or two, plain text."""
    accepted, result = calibration.acceptance, calibration.result
    of_result = {row["effect"]: row["is_accepted"] for row in result.transfers}
    earlier = [one["effect"] for one in calibration.effects if one["effect"] not in of_result]
    if accepted.is_recommended:
        names = ", ".join([*earlier, *(name for name, is_in_file in of_result.items() if is_in_file)]) or "noise"
        message = f"Recommended: the calibrated file ({names}), because {accepted.reason}."
    else:
        message = f"Keep your file, because {accepted.reason}."
    shown = {one.effect for one in accepted.transfers if one.is_accepted}
    rejected = [name for name in [*earlier, *of_result] if name not in shown]
    if rejected:
        message += f" Found, but not shown by held-out scans: {', '.join(rejected)}."
    last, first = calibration.rounds[-1], calibration.rounds[0]
    if left := calibration.result.unexplained:
        message += (
            " A dependence stays unexplained." if len(left) == 1 else f" {len(left)} dependences stay unexplained."
        )
    message += (
        f" Ground of the map {1000 * first.thickness_ground_m:.1f} → {1000 * last.thickness_ground_m:.1f} mm thick, "
        f"walls {1000 * first.thickness_walls_m:.1f} → {1000 * last.thickness_walls_m:.1f} mm."
    )
    if not calibration.settled:
        rounds = "1 round" if len(calibration.rounds) == 1 else f"{len(calibration.rounds)} rounds"
        message += f" After {rounds} it still changed: run on with more --rounds."
    return message


def format_page(calibration: SensorCalibration) -> str:
    """The HTML text."""
    last = calibration.rounds[-1]
    name = calibration.recording.name
    return document(
        f"Calibration on {name}",
        [
            fill(
                "<header><h1>Calibration on {}</h1><p class='verdict'>{}</p>{}</header>",
                name,
                headline(calibration),
                _facts(calibration),
            ),
            _report(calibration),
            _transfers(calibration),
            section(
                "Round by round",
                fill('<div class="charts">{}{}</div>', _thickness(calibration), _errors(calibration)),
                _links(calibration),
            ),
            section(
                "What was found",
                _findings(calibration),
                text="Effects of the sensor file to use, or of the last round if yours is kept; the round that first "
                "found each and 95 % intervals. Effects that move points are fitted again in every round.",
            ),
            _unexplained(calibration.result),
            _advice(last),
            _history(calibration),
            _undetermined(last),
            notes_section(last.notes, "What to know"),
        ],
        generator="cosim calibrate",
    )


def _facts(calibration: SensorCalibration) -> str:
    last = calibration.rounds[-1]
    floor = "unknown" if last.noise_floor is None else f"{last.noise_floor:.2f}"
    held = "none" if last.held_out_m is None else f"{1000 * last.held_out_m:.1f} mm"
    return facts(
        [
            ("Recommended", "yes" if calibration.acceptance.is_recommended else "no: keep your file"),
            ("Sensor file to use", calibration.sensor_out.relative_to(calibration.folder).as_posix()),
            ("Rounds", f"{len(calibration.rounds)}" + ("" if calibration.settled else ", not settled")),
            ("Aligned error of held-out scans, last round", f"{last.aligned_after:.2f}"),
            ("Noise floor", floor),
            ("Held-out scans across the map", held),
        ]
    )


_PUBLISHED_DEG = (("KISS-ICP", 0.205), ("PIN-SLAM", 0.195), ("CAE-LO", 0.22), ("M-detector", 0.15))
_HDL64_LASERS = (60, 64)


def _report(calibration: SensorCalibration) -> str:
    """Quality of the calibration in the terms of the field."""
    last, first, change = calibration.rounds[-1], calibration.rounds[0], calibration.acceptance.change
    rows = []
    if change is not None:
        rows.append(
            [
                "error of held-out scans, aligned, on the same beams",
                f"{change.before:.3f}",
                f"{change.after:.3f}",
                f"change {change.mean:+.3f} ({change.low:+.3f} to {change.high:+.3f}), {change.scans} scans, "
                f"{change.beams:,} beams",
            ]
        )
    for words, name in (("ground", "thickness_ground_m"), ("other surfaces", "thickness_walls_m")):
        rows.append(
            [
                f"thickness of planes, {words} [mm]",
                f"{1000 * getattr(first, name):.1f}",
                f"{1000 * getattr(last, name):.1f}",
                "median standard deviation across a plane",
            ]
        )
    if first.held_out_m is not None and last.held_out_m is not None:
        rows.append(
            [
                "held-out scans across the map [mm]",
                f"{1000 * first.held_out_m:.1f}",
                f"{1000 * last.held_out_m:.1f}",
                "robust standard deviation",
            ]
        )
    if last.directions is not None:
        directions = last.directions
        rows.append(
            [
                "ray direction, half against half [°]",
                "",
                f"{directions['mean_deg']:.4f}",
                f"mean over {directions['lasers']} lasers; largest {directions['max_deg']:.4f}°; "
                f"elevations of the cones only {directions['by_elevation_deg']:.4f}°",
            ]
        )
    parts = [table(["quantity", "before", "after", "evidence"], rows, words=(0, 3))]
    offset = estimates_of(calibration.result).get(("elevation_offset", "offset_deg"))
    if offset is not None and last.directions and _HDL64_LASERS[0] <= last.directions["lasers"] <= _HDL64_LASERS[1]:
        value, (low, high) = offset
        published = ", ".join(f"{name} {degrees}°" for name, degrees in _PUBLISHED_DEG)
        parts.append(
            fill(
                "<p>Elevation offset {:.3f}° ({:.3f} to {:.3f}). Corrections by hand in public code for KITTI's "
                "HDL-64E: {}.</p>",
                value,
                low,
                high,
                published,
            )
        )
    return section("Calibration report", *parts)


def _transfers(calibration: SensorCalibration) -> str:
    """Section with the findings that lower the error of held-out scans."""
    rows = []
    for one in calibration.acceptance.transfers:
        change = "not measured" if one.change is None else f"{one.change:+.3f} ({one.low:+.3f} to {one.high:+.3f})"
        by = {"step": "added on the same map", "map": "new map made with it"}[one.by]
        rows.append(
            [f"{one.round}", one.effect, change, by, "yes" if one.is_accepted else "no: not in the recommended file"]
        )
    if not rows:
        return ""
    heads = ["round", "finding", "change of the error of held-out scans", "measured", "transfers"]
    text = "A finding is in the recommended file only if the error of scans that took no part falls beyond doubt."
    return section("What held-out scans confirm", table(heads, rows, words=(1, 2, 3, 4)), text=text)


def _advice(last: Round) -> str:
    rows = []
    for one in last.advice:
        now = "more than its allowed range" if one["now"] is None else f"{one['now']:.3g} {one['unit']}"
        rows.append([f"{one['effect']}, {one['parameter']}", now, one["words"]])
    if not rows:
        return ""
    text = (
        "Parameters that this recording leaves undetermined: half width of the interval or smallest detectable value, "
        "and the candidate drive with the largest expected information, traced with this sensor's beams."
    )
    return section("What to record next", table(["parameter", "now", "drive"], rows, words=(0, 1, 2)), text=text)


def _thickness(calibration: SensorCalibration) -> str:
    ground = 1000 * np.array([one.thickness_ground_m for one in calibration.rounds])
    walls = 1000 * np.array([one.thickness_walls_m for one in calibration.rounds])
    plot = Plot(
        _rounds_axis(calibration), Axis(0, nice_top(float(np.nanmax([ground, walls]))), "thickness [mm]"), "map"
    )
    plot.line(_numbers(calibration), ground, "a", dots=True)
    plot.line(_numbers(calibration), walls, "b", dots=True)
    return figure(
        "Thickness of the map", "ground (yellow) and other surfaces (blue), points freed of what was known", plot.svg()
    )


def _errors(calibration: SensorCalibration) -> str:
    lines = [
        ([one.error for one in calibration.rounds], "a"),
        ([one.error_aligned for one in calibration.rounds], "b"),
        ([np.nan if one.noise_floor is None else one.noise_floor for one in calibration.rounds], "c"),
    ]
    top = nice_top(float(np.nanmax([max(values) for values, _ in lines])))
    plot = Plot(_rounds_axis(calibration), Axis(0, top, "error"), "error by round")
    for values, style in lines:
        plot.line(_numbers(calibration), np.array(values, float), style, dots=True)
    return figure(
        "Error by round",
        "initial sensor of each round, on held-out scans: at the given poses (yellow; the map absorbs a part of "
        "missing effects), at fitted poses and surfaces (blue), and the noise floor (green)",
        plot.svg(),
    )


def _rounds_axis(calibration: SensorCalibration) -> Axis:
    names = ["", *(f"round {one.number}" for one in calibration.rounds)]
    return Axis(0.5, len(calibration.rounds) + 0.5, "", names=names)


def _numbers(calibration: SensorCalibration) -> np.ndarray:
    return np.array([one.number for one in calibration.rounds], float)


def _links(calibration: SensorCalibration) -> str:
    rows = []
    for one in calibration.rounds:
        folder = one.sensor_out.rpartition("/")[0]
        names = [finding["effect"] for finding in one.findings] + [f"{name} anew" for name in one.refitted]
        added = ", ".join(names) or "no further effect"
        rows.append(
            [
                f"{one.number}",
                added,
                fill('<a href="{}/map/index.html">map</a>', folder),
                fill('<a href="{}/diagnosis/index.html">diagnosis</a>', folder),
                fill('<a href="{}">sensor file</a>', one.sensor_out),
            ]
        )
    return table(["round", "found", "", "", ""], rows, words=(1, 2, 3, 4))


def _findings(calibration: SensorCalibration) -> str:
    rows = [
        [
            one["effect"],
            f"{one['round']}",
            said_params(one["effect"], one["params"], one["ci95"]),
            f"{one['p_value']:.2g}",
            ", ".join(one["also_possible"]) or "–",
        ]
        for one in calibration.effects
    ]
    if not rows:
        return Markup("<p>No effect is missing from the sensor file.</p>")
    return table(["effect", "round", "parameters", "p", "or"], rows, words=(0, 2, 4))


def said_params(effect: str, params: Mapping[str, Any], ci95: Mapping[str, Any]) -> str:
    """Parameters with units and intervals; of lists the extremes; what exceeds its allowed range is not determined."""
    words, parts = Vocabulary(), []
    for name, value in params.items():
        interval, unit = ci95.get(name), words.parameter(effect, name).unit
        unit = f" {unit}" if unit else ""
        if isinstance(value, list | tuple):
            numbers = [number for number in value if number is not None]
            spread = f"{min(numbers):.3g} to {max(numbers):.3g}{unit}" if numbers else UNDETERMINED
            parts.append(f"{name} of {len(value)} lasers {spread}")
        elif value is None or not words.is_determined(effect, name, interval):
            parts.append(f"{name} {UNDETERMINED}")
        elif isinstance(value, float) and interval:
            parts.append(f"{name} {value:.4g} ({interval[0]:.4g} to {interval[1]:.4g}){unit}")
        else:
            parts.append(f"{name} {value:.4g}{unit}" if isinstance(value, float) else f"{name} {value}")
    return "; ".join(parts)


def _unexplained(result: Round) -> str:
    shapes = [
        [dependence_words(one["channel"], one["covariates"]), str(one["form"]), p_cell(one["p_value"])]
        for one in result.unknowns
    ]
    left = [
        [unexplained_words(row), size_words(row), p_cell(row.p_value)]
        for row in (Unexplained.of_json(one) for one in result.unexplained)
    ]
    parts = []
    if shapes:
        parts.append(table(["effect outside the catalogue", "shape", "p"], shapes, words=(0, 1)))
    if left:
        parts.append(table(["dependence", "size", "p"], left, words=(0,)))
    return section("Not explained", *(parts or [Markup("<p>Nothing significant is left.</p>")]))


def _history(calibration: SensorCalibration) -> str:
    rows = [
        [
            one.sensor,
            _few(one.effects),
            f"{one.error:.3f}",
            f"{one.error_aligned:.3f}",
            f"{1000 * one.thickness_ground_m:.1f}",
            f"{1000 * one.thickness_walls_m:.1f}",
        ]
        for one in calibration.tried
    ]
    heads = ["sensor file", "effects", "error", "aligned", "ground [mm]", "walls [mm]"]
    return section("Every sensor file tried on this recording", table(heads, rows, words=(0, 1)))


def _few(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"


def _undetermined(last: Round) -> str:
    words, rows = Vocabulary(), []
    for effect, values in sorted(last.not_told.items()):
        report = [
            f"{name}: more than its allowed range" if value is None else f"{name} {words.quantity(effect, name, value)}"
            for name, value in values.items()
        ]
        rows.append([effect, ", ".join(report)])
    if not rows:
        return ""
    text = "The smallest amplitude of each that this recording would have shown, in four of five such drives."
    return section("What would have been seen", table(["effect", "from"], rows, words=(0, 1)), text=text)
