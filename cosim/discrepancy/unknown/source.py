"""The effect of an unknown dependence as the text of a plug-in file that a user can read, edit and run."""

from __future__ import annotations

import textwrap

from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import DESCRIPTIONS, base_of, bounds, class_attributes, equation
from cosim.discrepancy.unknown.formula import Formula, number_code
from cosim.discrepancy.unknown.terms import Wave
from sensors.effects.covariates import COVARIATES

_WIDTH = 110
_CHANNELS = {
    "range": "measured range minus true range",
    "azimuth_error": "true azimuth minus reported azimuth, counter-clockwise",
    "elevation_error": "true elevation minus reported elevation",
    "intensity": "logarithm of the factor of the intensity",
    "intensity_offset": "shift of the intensity",
    "drop": "relative change of the probability of a return",
    "range_variance": "change of the logarithm of the standard deviation of the sensor's range noise",
    "intensity_variance": "change of the logarithm of the standard deviation of the sensor's intensity noise",
    "spurious": "share of beams that return from anywhere",
    "early": "share of beams that return from before the surface",
    "late": "share of beams that return from behind the surface",
}


def effect_source(unknown: UnknownEffect | Curve) -> str:
    """Return the Python source of a file with the effect, in a class of the name `UnknownEffect.class_name`."""
    unknown = UnknownEffect.of(unknown) if isinstance(unknown, Curve) else unknown
    return _source(unknown) if unknown.is_function else _source_without_formula(unknown)


def _source(unknown: UnknownEffect) -> str:
    curve, base = unknown.curve, base_of(unknown)
    arguments = ", ".join(("x", "y")[: len(curve.covariates)])
    body, constants, used = _body(unknown)
    is_numeric = all(not isinstance(axis, tuple) for axis in curve.x) or bool(curve.frequency_hz)
    unit = f" [{curve.unit}]" if curve.unit else ""
    types = "np.ndarray" if is_numeric else "Any"
    imports = ["from typing import Any, ClassVar" if not is_numeric else "from typing import ClassVar", ""]
    imports += ["import numpy as np", "", "from sensors.effects.base import number"]
    imports += [f"from sensors.effects.channels import {base.__name__}"]
    imports += [f"from sensors.effects.covariates import {', '.join(used)}"] if used else []
    units = unknown.parameter_units
    fields = [
        f'    {name}: float = number("{DESCRIPTIONS[name]}", unit="{units[name]}"{_bound(name, value)})'
        for name, value in unknown.parameters.items()
    ]
    return "\n".join(
        [
            _heading(unknown, _CHANNELS[curve.channel] + unit),
            "\n".join(imports),
            "",
            *([constants, ""] if constants else []),
            "",
            f"class {unknown.class_name}({base.__name__}):",
            f'    """{_short(base.__doc__)}"""',
            "",
            _attributes(unknown),
            "",
            *fields,
            "",
            f"    def error(self, {', '.join(f'{name}: {types}' for name in arguments.split(', '))}) -> np.ndarray:",
            f'        """Return the error{unit} at values of the covariates."""',
            *body,
            "",
        ]
    )


def _source_without_formula(unknown: UnknownEffect) -> str:
    """Source of a shared error, or of an error of objects, which class attributes define completely."""
    base = base_of(unknown)
    unit = f" [{unknown.curve.unit}]" if unknown.curve.unit else ""
    shared = f"standard deviation of an error that the beams of a {unknown.shared_by} share{unit}"
    of_objects = f"size or position of objects of a class in measurements minus that in the twin{unit}"
    return "\n".join(
        [
            _heading(unknown, shared if unknown.curve.is_shared else of_objects),
            "from typing import ClassVar",
            "",
            f"from {base.__module__} import {base.__name__}",
            "",
            "",
            f"class {unknown.class_name}({base.__name__}):",
            f'    """{_short(base.__doc__)}"""',
            "",
            _attributes(unknown),
            "",
        ]
    )


def _heading(unknown: UnknownEffect, what: str) -> str:
    """The docstring of the file, and the future import."""
    curve = unknown.curve
    lines = [f'"""Unknown effect, found in measurements: {curve.channel} by {" and ".join(curve.covariates)}.', ""]
    unit = f" [{curve.unit}]" if curve.unit and not curve.is_shared else ""
    sentences = [f"Error: {what}.", f"Size{unit}: {unknown.form}."]
    if unknown.variables:
        sentences.append(f"Here {unknown.variables.replace('x: ', 'x is the ', 1).replace('; y: ', ', y the ')}.")
    is_formula = bool(unknown.terms) and all(isinstance(term, Formula) for term in unknown.terms)
    share = f"{100 * unknown.r2:.0f} %" if unknown.r2 > 0 else "nothing"
    explained = f"The formula explains {share} of the measured curve (R²); " if is_formula else ""
    sentences.append(f"{explained}p = {curve.p_value:.2g}.")
    sentences += _limits(unknown)
    sentences.append("Rename the class and `name` when the cause is known; `cosim add` fits the parameters again.")
    lines += [part for text in sentences for part in textwrap.wrap(text, _WIDTH)]
    return "\n".join([*lines, '"""', "", "from __future__ import annotations", ""])


def _limits(unknown: UnknownEffect) -> list[str]:
    """Limits of the covariates in a simulation."""
    if unknown.objects is not None:
        return ["It is an error of the twin: correct the objects there rather than keep it in the sensor."]
    if unknown.curve.is_shared:
        return []
    found = []
    for name in unknown.curve.covariates:
        if not COVARIATES[name].is_simulated:
            found.append(f"A simulation does not know the covariate `{name}`: there the effect does nothing.")
        elif COVARIATES[name].of_signal and unknown.curve.channel in ("azimuth_error", "elevation_error"):
            found.append(f"`{name}` is not known before beams are traced: the effect does nothing.")
        elif name in ("scan", "frame_time", "time"):
            found.append(
                "It depends on the times of the measured scans: scans at other times get what the formula says."
            )
    return found


def _attributes(unknown: UnknownEffect) -> str:
    """Class attributes as Python."""
    lines = []
    for name, value in class_attributes(unknown).items():
        if name == "equation":
            lines += _wrapped_text(equation(unknown))
        else:
            lines.append(f"    {name}: ClassVar = {_literal(value)}")
    return "\n".join(lines)


def _wrapped_text(text: str) -> list[str]:
    """The equation as a string, over several lines where it is long."""
    parts = textwrap.wrap(text, 88, drop_whitespace=False, break_long_words=False)
    quoted = [f'"{part}"' for part in parts]
    if len(quoted) == 1:
        return [f"    equation: ClassVar = {quoted[0]}"]
    return ["    equation: ClassVar = (", *(f"        {part}" for part in quoted), "    )"]


def _literal(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f'"{name}": {_literal(item)}' for name, item in value.items()) + "}"
    if isinstance(value, tuple):
        inner = ", ".join(_literal(item) for item in value)
        return f"({inner},)" if len(value) == 1 else f"({inner})"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _body(unknown: UnknownEffect) -> tuple[list[str], str, list[str]]:
    """Lines of `error`, the constants before the class, and names to import from `covariates`."""
    if unknown.grid is not None:
        code = unknown.grid.code("x", "y", lambda name: f"self.{name}")
        return [f"        return {code}"], unknown.grid.constants(), ["cell_of", "nearest_row"]
    codes, constants = [], []
    for number, (term, variable) in enumerate(zip(unknown.terms, ("x", "y"), strict=False)):
        values = term.values if isinstance(term, Formula) else term.parameters
        fitted = unknown.parameters if number == 0 else {}

        def name_of(name: str, values: object = values, fitted: object = fitted) -> str:
            return f"self.{name}" if name in fitted else number_code(values[name])  # type: ignore

        codes.append(term.code(variable, name_of).removeprefix("1.0 * "))
        if not isinstance(term, Formula):
            constants.append(term.constants(variable))
    used = [name for name in ("level_at", "wrapped") if any(f"{name}(" in code for code in codes)]
    if len(codes) == 1:
        first = unknown.terms[0]
        before = [f"        {first.preparation('x')}"] if isinstance(first, Wave) else []
        return [*before, f"        return {codes[0]}"], "\n".join(constants), used
    names = ("first", "second")
    lines = [line for name, code in zip(names, codes, strict=False) for line in _assignment(name, code)]
    return [*lines, f"        return {' * '.join(names[: len(codes)])}"], "\n".join(constants), used


def _assignment(name: str, code: str) -> list[str]:
    line = f"        {name} = {code}"
    return [line] if len(line) <= _WIDTH else [f"        {name} = (", f"            {code}", "        )"]


def _bound(name: str, value: float) -> str:
    return "".join(f", {side}={bound:g}" for side, bound in bounds(name, value).items())


def _short(text: str | None) -> str:
    return " ".join((text or "").split("\n\n")[0].split())
