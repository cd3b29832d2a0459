"""An unknown effect as a plug-in that runs as it is: its source, and the effect to be fitted."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

from cosim.discrepancy.sampling.gathering import BESIDE
from cosim.discrepancy.unknown.shape import Shape
from sensors.effects.base import Effect
from sensors.effects.registry import find_effect

_BASES = {"range": "PointEffect", "intensity": "PointEffect", "drop": "DetectionEffect"}
_COVARIATES = {
    "range": "returns.range_m",
    "incidence": "np.degrees(np.arccos(shot.cos_incidence(returns)))",
    "elevation": "np.degrees(np.arcsin(shot.rays.direction[returns.beam, 2]))",
    "ring": "shot.rays.ring[returns.beam]",
    "block": "shot.block[returns.beam]",
    "azimuth": "shot.rays.azimuth[returns.beam]",
    "firing_time": "shot.rays.time_s[returns.beam]",
    "phase": "shot.firing(returns)",
    "material": "returns.material",
    "kind": 'shot.named("kinds", returns)',
    "model": 'shot.named("models", returns)',
    "albedo": "returns.reflectance",
    "intensity": "returns.intensity",
    "frame_time": "shot.frame_time_s",
    "scan": "shot.frame_time_s",
    "speed": "np.linalg.norm(shot.world.ego.velocity_mps)",
    "acceleration": "shot.world.ego.forward_acceleration_mps2",
    "yaw_rate": "shot.world.ego.yaw_rate_radps",
    "world_x": "shot.points_in_world(returns)[:, 0]",
    "world_y": "shot.points_in_world(returns)[:, 1]",
    **{name: f'shot.beside("{name}", returns)' for name in BESIDE},
}
_APPLY = {
    "range": (
        "apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns",
        "The returns, their ranges off.",
        "return replace(returns, range_m=returns.range_m + self.error(returns, shot).astype(np.float32))",
    ),
    "intensity": (
        "apply(self, returns: Returns, shot: Shot, rng: np.random.Generator) -> Returns",
        "The returns, their intensities off by a share of themselves.",
        "return replace(returns, intensity=returns.intensity * (1 + self.error(returns, shot)).astype(np.float32))",
    ),
    "drop": (
        "kept(self, returns: Returns, shot: Shot) -> np.ndarray",
        "The chance of each return to be noticed.",
        "return np.clip(1 + self.error(returns, shot), 0, 1)",
    ),
}


_WORDS = {
    "amplitude": "how large it is",
    "level": "the same everywhere",
    "start": "where it begins",
    "end": "where it ends",
    "edge": "where it begins",
    "centre": "where it is strongest",
    "width": "how far it reaches",
    "length": "how fast it fades",
    "power": "the exponent",
    "wave": "how fast it swings",
    "shift": "its phase",
    "period": "after which it comes again",
}
_INVERSE = ("wave", "power", "shift")
_ABOVE_ZERO = ("width", "length", "period")


def class_name(shape: Shape) -> str:
    """Name of its class."""
    return "".join(word.capitalize() for word in shape.name.split("_"))


def effect_source(shape: Shape) -> str:
    """Python source of a plug-in file with one effect, named by `class_name`."""
    signature, says, body = _APPLY[shape.channel]
    parameters, example, neutral, fields, law = _law(shape)
    base = _BASES[shape.channel]
    imports = "from dataclasses import replace\n" if "replace(" in body else ""
    what = f"{shape.channel} by {' and '.join(shape.covariates)}"
    return f'''"""An effect that measurements show and no known one explains: {what}.

Shape found: {shape.text} (x: {shape.covariate}{f" [{shape.unit}]" if shape.unit else ""}), R² {shape.r2:.2f}.
Give it a name and a cause when you know them; parameters can be fitted anew with `cosim add`.
"""

from __future__ import annotations

{imports}from typing import ClassVar

import numpy as np

from sensors.effects.base import {base}, number{", per_ring" if "per_ring(" in fields else ""}
from sensors.returns import Returns
from sensors.shot import Shot


class {class_name(shape)}({base}):
    """{shape.text}, x the {" and y the ".join(shape.covariates).replace("_", " ")}."""

    name: ClassVar = "{shape.name}"
    channel: ClassVar = "{shape.channel}"
    equation: ClassVar = "{shape.text}"
    reference: ClassVar = "found in measurements"
    example: ClassVar = {example}
    neutral: ClassVar = {neutral}
    shapes: ClassVar = ({parameters},)

{fields}
    def error(self, returns: Returns, shot: Shot) -> np.ndarray:
        """What is added at each return, (m,)."""
        x = np.broadcast_to({_covariate(shape)}, len(returns))
{law}

    def {signature}:
        """{says}"""
        {body}
'''


def shape_effect(shape: Shape) -> Effect:
    """The effect of a shape, at the size found."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "unknown_effect.py"
        file.write_text(effect_source(shape), encoding="utf-8")
        kind = find_effect(f"{file.name}:{class_name(shape)}", Path(folder))
    return kind.model_validate(kind.example)


def _covariate(shape: Shape) -> str:
    """Python that gives x; phases from −π to π."""
    if shape.covariate == "phase":
        return f"np.mod({_COVARIATES['phase']}, {shape.period!r}) / {shape.period!r} * 2 * np.pi - np.pi"
    return _COVARIATES[shape.covariate]


def _law(shape: Shape) -> tuple[str, str, str, str, str]:
    """Shape parameters, example, neutral, field lines and the body of `error`."""
    unit = {"range": "m"}.get(shape.channel, "")
    if shape.formula is None:
        field = f'    amplitude: float = number("how much of it there is", unit="{unit}")\n'
        return "{}", '{"amplitude": 1.0}', '{"amplitude": 0.0}', field, _table(shape)
    values = {name: float(f"{value:.6g}") for name, value in shape.formula.parameters.items()}
    amplitudes = ("amplitude", "level")
    neutral = {name: 0.0 if name in amplitudes else value for name, value in values.items()}
    shapes = {name: value for name, value in values.items() if name not in amplitudes}
    fields = ""
    for name in values:
        of = unit if name in amplitudes else "" if name in _INVERSE else shape.unit
        bound = f", ge={min(1e-6, values[name] / 100):.1g}" if name in _ABOVE_ZERO and values[name] > 0 else ""
        fields += f'    {name}: float = number("{_WORDS.get(name, "of the shape")}", unit="{of}"{bound})\n'
    code = shape.formula.code
    for name in sorted(values, key=len, reverse=True):
        code = _replaced(code, name)
    law = f"        return {code}"
    if shape.factor is not None:
        second = shape.factor.formula.code
        for name, value in sorted(shape.factor.formula.parameters.items(), key=lambda one: -len(one[0])):
            second = re.sub(rf"(?<![\w.]){name}(?!\w)", f"({value:.6g})", second)
        second = re.sub(r"(?<![\w.])x(?!\w)", "y", second)
        of_second = _COVARIATES[shape.factor.covariate]
        law = f"        y = np.broadcast_to({of_second}, len(returns))\n        return ({code}) * ({second})"
    return _plain(shapes), _plain(values), _plain(neutral), fields, law


def _table(shape: Shape) -> str:
    """The body of `error` for categories and for levels of scans."""
    values = [round(float(value), 6) for value in shape.y]
    if shape.is_of_scans:
        times = [round(float(value), 6) for value in shape.x]
        return (
            f"        times, levels = np.array({times}), np.array({values})\n"
            "        nearest = np.abs(x[:, None] - times).argmin(1)\n"
            "        known = np.abs(x - times[nearest]) < 0.01  # another scan has another level, nobody knows which\n"
            "        return self.amplitude * np.where(known, levels[nearest], 0.0)"
        )
    if shape.covariate in ("kind", "model"):
        table = dict(zip(shape.names, values, strict=True))
        values = "np.array([table.get(key, 0.0) for key in x.tolist()])"
        return f"        table = {table}\n        return self.amplitude * {values}"
    codes = {
        "ring": lambda name: name,
        "block": lambda name: str(("upper", "lower").index(name)),
        "material": lambda name: f"material_index({name!r})",
    }
    code = codes.get(shape.covariate, lambda name: str(("seen", "lost").index(name)))
    lines = "".join(f"        table[{code(name)}] = {value}\n" for name, value in zip(shape.names, values, strict=True))
    imported = "        from assets.materials import material_index\n\n" if shape.covariate == "material" else ""
    return f"{imported}        table = np.zeros(256)\n{lines}        return self.amplitude * table[x.astype(int)]"


def _plain(values: dict[str, float]) -> str:
    return "{" + ", ".join(f'"{name}": {value!r}' for name, value in values.items()) + "}"


def _replaced(code: str, name: str) -> str:
    """`name` as an attribute of self, where it stands as a word of its own."""
    return re.sub(rf"(?<![\w.]){name}(?!\w)", f"self.{name}", code)
