"""The page of a calibration: what was found round by round, how map and error changed, what nobody knows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from cosim.recordings.calibration.loop import Calibration
from cosim.recordings.calibration.rounds import Round
from cosim.report import document, facts, figure, notes_section, section, table
from cosim.report.plot import Axis, Plot, nice_top

_MOST_SHOWN = 4


def headline(found: Calibration) -> str:
    """The outcome in a sentence or two, plain text."""
    names = found_effects(found)
    last, first = found.rounds[-1], found.rounds[0]
    silent = (
        "No effect of the catalogue was found."
        if last.unknowns or last.unexplained
        else "Nothing is missing that these scans would show."
    )
    said = f"Found: {', '.join(names)}." if names else silent
    if last.unknowns:
        said += f" {len(last.unknowns)} dependences that no known effect explains were added as shapes."
    if last.unexplained:
        said += f" {len(last.unexplained)} things stay unexplained."
    said += (
        f" Error of untouched scans, poses and surfaces aligned, {first.error_aligned:.2f} → {last.aligned_after:.2f}; "
        f"ground of the map "
        f"{1000 * first.thickness_ground_m:.1f} → {1000 * last.thickness_ground_m:.1f} mm thick."
    )
    if not found.settled:
        rounds = "1 round" if len(found.rounds) == 1 else f"{len(found.rounds)} rounds"
        said += f" After {rounds} it still changed: run on with more --rounds."
    return said


def found_effects(found: Calibration) -> list[str]:
    """Names of what was found, in order."""
    return list(dict.fromkeys(one["effect"] for each in found.rounds for one in each.findings))


def format_page(found: Calibration) -> str:
    """The HTML text."""
    last = found.rounds[-1]
    name = found.recording.name
    return document(
        f"Calibration on {name}",
        [
            f"<header><h1>Calibration on {escape(name)}</h1><p class='verdict'>{escape(headline(found))}</p>"
            f"{_facts(found)}</header>",
            section("Round by round", f'<div class="charts">{_thickness(found)}{_errors(found)}</div>', _links(found)),
            section(
                "What was found",
                _findings(found),
                text="Each effect with its latest parameters and their 95 % intervals.",
            ),
            _unexplained(last),
            _history(found),
            _not_told(last),
            notes_section(last.notes, "What to know"),
        ],
        generator="cosim calibrate",
    )


def _facts(found: Calibration) -> str:
    last = found.rounds[-1]
    floor = "unknown" if last.noise_floor is None else f"{last.noise_floor:.2f}"
    held = "none" if last.held_out_m is None else f"{1000 * last.held_out_m:.1f} mm"
    return facts(
        [
            ("Sensor file to use", escape(last.sensor_out)),
            ("Rounds", f"{len(found.rounds)}" + ("" if found.settled else ", not settled")),
            ("Error, aligned", f"{last.aligned_after:.2f}"),
            ("Noise floor", floor),
            ("Untouched scans across the map", held),
        ]
    )


def _thickness(found: Calibration) -> str:
    ground = 1000 * np.array([one.thickness_ground_m for one in found.rounds])
    walls = 1000 * np.array([one.thickness_walls_m for one in found.rounds])
    plot = Plot(_rounds_axis(found), Axis(0, nice_top(float(np.nanmax([ground, walls]))), "thickness [mm]"), "map")
    plot.line(_numbers(found), ground, "a", dots=True)
    plot.line(_numbers(found), walls, "b", dots=True)
    return figure(
        "Thickness of the map", "ground (yellow) and other surfaces (blue), points freed of what was known", plot.svg()
    )


def _errors(found: Calibration) -> str:
    lines = [
        ([one.error for one in found.rounds], "a"),
        ([one.error_aligned for one in found.rounds], "b"),
        ([np.nan if one.noise_floor is None else one.noise_floor for one in found.rounds], "c"),
    ]
    top = nice_top(float(np.nanmax([max(values) for values, _ in lines])))
    plot = Plot(_rounds_axis(found), Axis(0, top, "error"), "error by round")
    for values, style in lines:
        plot.line(_numbers(found), np.array(values, float), style, dots=True)
    return figure(
        "Error by round",
        "of the sensor that each round began with, on untouched scans: as poses are (yellow; the map takes up some of "
        "what is missing), poses and surfaces where the fit has them (blue), noise alone (green)",
        plot.svg(),
    )


def _rounds_axis(found: Calibration) -> Axis:
    names = ["", *(f"round {one.number}" for one in found.rounds)]
    return Axis(0.5, len(found.rounds) + 0.5, "", names=names)


def _numbers(found: Calibration) -> np.ndarray:
    return np.array([one.number for one in found.rounds], float)


def _links(found: Calibration) -> str:
    rows = []
    for one in found.rounds:
        place = one.sensor_out.rpartition("/")[0]
        said = [finding["effect"] for finding in one.findings] + [f"{name} anew" for name in one.refitted]
        added = ", ".join(said) or "nothing more"
        rows.append(
            [
                f"{one.number}",
                escape(added),
                f'<a href="{place}/map/index.html">map</a>',
                f'<a href="{place}/diagnosis/index.html">diagnosis</a>',
                f'<a href="{one.sensor_out}">sensor file</a>',
            ]
        )
    return table(["round", "found", "", "", ""], rows, words=(1, 2, 3, 4))


def _findings(found: Calibration) -> str:
    latest: dict[str, tuple[int, Mapping[str, Any]]] = {}
    for each in found.rounds:
        for one in each.findings:
            latest[one["effect"]] = (each.number, one)
        for name, one in each.refitted.items():
            if name in latest:
                latest[name] = (latest[name][0], {**latest[name][1], **one})
    rows = [
        [
            escape(name),
            f"{number}",
            escape(said_params(one["params"], one["ci95"])),
            f"{one['p_value']:.2g}",
            escape(", ".join(one["also_possible"]) or "–"),
        ]
        for name, (number, one) in latest.items()
    ]
    if not rows:
        return "<p>Nothing that the sensor file lacks.</p>"
    return table(["effect", "round", "parameters", "p", "or"], rows, words=(0, 2, 4))


def said_params(params: Mapping[str, Any], ci95: Mapping[str, Any]) -> str:
    """Parameters with their intervals; of lists the first few."""
    said = []
    for name, value in params.items():
        interval = ci95.get(name)
        if isinstance(value, list):
            shown = ", ".join(f"{number:.3g}" for number in value[:_MOST_SHOWN])
            said.append(f"{name} {shown}" + (" …" if len(value) > _MOST_SHOWN else ""))
        elif isinstance(value, float) and interval:
            said.append(f"{name} {value:.4g} ({interval[0]:.4g} to {interval[1]:.4g})")
        else:
            said.append(f"{name} {value:.4g}" if isinstance(value, float) else f"{name} {value}")
    return "; ".join(said)


def _unexplained(last: Round) -> str:
    shapes = [
        [one["channel"], escape(", ".join(one["covariates"])), escape(str(one["form"])), f"{one['p_value']:.2g}"]
        for one in last.unknowns
    ]
    left = [
        [
            one["channel"],
            escape(", ".join(one["covariates"]) or f"as {one.get('looks_like', '')} would make it"),
            f"{one['size']:.3g} {one['unit']}",
            f"{one['p_value']:.2g}",
        ]
        for one in last.unexplained
    ]
    parts = []
    if shapes:
        parts.append(table(["channel", "depends on", "shape", "p"], shapes, words=(0, 1, 2)))
    if left:
        parts.append(table(["channel", "depends on", "size", "p"], left, words=(0, 1)))
    return section("What nobody knows", *(parts or ["<p>Nothing significant is left.</p>"]))


def _history(found: Calibration) -> str:
    rows = [
        [
            escape(one.sensor),
            escape(_few(one.effects)),
            f"{one.error:.3f}",
            f"{one.error_aligned:.3f}",
            f"{1000 * one.thickness_ground_m:.1f}",
            f"{1000 * one.thickness_walls_m:.1f}",
        ]
        for one in found.tried
    ]
    heads = ["sensor file", "effects", "error", "aligned", "ground [mm]", "walls [mm]"]
    return section("Every sensor file tried on this recording", table(heads, rows, words=(0, 1)))


def _few(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"


def _not_told(last: Round) -> str:
    rows = [
        [
            escape(effect),
            escape(", ".join(f"{name} {value:.3g}" for name, value in values.items() if value is not None)),
        ]
        for effect, values in sorted(last.not_told.items())
    ]
    if not rows:
        return ""
    text = "The smallest amplitude of each that this recording would have shown, in four of five such drives."
    return section("What would have been seen", table(["effect", "from"], rows, words=(0, 1)), text=text)
