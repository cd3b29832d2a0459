"""An unknown effect as a plug-in file that runs as it is."""

from __future__ import annotations

from cosim.discrepancy.unknown.shape import Shape

_BASES = {
    "range": "PointEffect",
    "intensity": "PointEffect",
    "drop": "DetectionEffect",
}
_COVARIATES = {
    "range": "returns.range_m",
    "incidence": "np.degrees(np.arccos(shot.cos_incidence(returns)))",
    "ring": "shot.rays.ring[returns.beam]",
    "azimuth": "shot.rays.azimuth[returns.beam]",
    "material": "returns.material",
    "albedo": "returns.reflectance",
    "intensity": "returns.intensity",
    "previous_intensity": "shot.previous_intensity(returns)",
    "frame_time": "shot.frame_time_s",
    "speed": "np.linalg.norm(shot.world.ego.velocity_mps)",
    "acceleration": "shot.world.ego.forward_acceleration_mps2",
    "yaw_rate": "shot.world.ego.yaw_rate_radps",
    "world_x": "shot.points_in_world(returns)[:, 0]",
    "world_y": "shot.points_in_world(returns)[:, 1]",
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


def effect_name(shape: Shape) -> str:
    """Name of the effect in sensor files."""
    return f"unknown_{shape.channel}_by_{shape.covariate}"


def class_name(shape: Shape) -> str:
    """Name of its class."""
    return "".join(word.capitalize() for word in effect_name(shape).split("_"))


def effect_source(shape: Shape) -> str:
    """Python source of a plug-in file with one effect, named by `class_name`."""
    signature, says, body = _APPLY[shape.channel]
    parameters, example, neutral, fields, law = _law(shape)
    base = "EchoEffect" if _is_light(shape) else _BASES[shape.channel]
    imports = "from dataclasses import replace\n" if "replace(" in body else ""
    return f'''"""An effect that measurements show and no known one explains: {shape.channel} by {shape.covariate}.

Shape found: {shape.text} (x: {shape.covariate}{f" [{shape.unit}]" if shape.unit else ""}), R² {shape.r2:.2f}.
{_acts(shape)}Give it a name and a cause when you know them; parameters can be fitted anew with `cosim add`.
"""

from __future__ import annotations

{imports}from typing import ClassVar

import numpy as np

from sensors.effects.base import {base}, number{", per_ring" if "per_ring(" in fields else ""}
from sensors.returns import Returns
from sensors.shot import Shot


class {class_name(shape)}({base}):
    """{shape.text}, x the {shape.covariate.replace("_", " ")}."""

    name: ClassVar = "{effect_name(shape)}"
    channel: ClassVar = "{shape.channel}"
    equation: ClassVar = "{shape.text}"
    reference: ClassVar = "found in measurements"
    example: ClassVar = {example}
    neutral: ClassVar = {neutral}
    shapes: ClassVar = ({parameters},)

{fields}
    def error(self, returns: Returns, shot: Shot) -> np.ndarray:
        """What is added at each return, (m,)."""
        x = np.broadcast_to({_COVARIATES[shape.covariate]}, len(returns))
{law}

    def {signature}:
        """{says}"""
        {body}
'''


def _is_light(shape: Shape) -> bool:
    """Whether the echo is another before anything is read of it."""
    return shape.channel == "intensity" and shape.acts == "light"


def _acts(shape: Shape) -> str:
    """Where it acts, for the file's heading."""
    if shape.channel != "intensity":
        return ""
    if _is_light(shape):
        return "It acts on the light: what hangs on an echo's strength, its range or its chance to be seen, follows.\n"
    return "It acts on what is read: ranges and chances to be seen stay as they are.\n"


def _law(shape: Shape) -> tuple[str, str, str, str, str]:
    """Shape parameters, example, neutral, field lines and the body of `error`."""
    unit = {"range": "m"}.get(shape.channel, "")
    if shape.formula is None:
        table = {name: round(float(value), 6) for name, value in zip(shape.names, shape.y, strict=True)}
        keys = ", ".join(f"{key if shape.covariate == 'ring' else repr(key)}: {value}" for key, value in table.items())
        lookup = (
            "        table = np.zeros(256)\n"
            f"        for key, value in {{{keys}}}.items():\n"
            + (
                "            table[key] = value\n"
                if shape.covariate == "ring"
                else "            table[material_index(key)] = value\n"
            )
            + "        return self.amplitude * table[x]"
        )
        if shape.covariate == "material":
            lookup = "        from assets.materials import material_index\n\n" + lookup
        field = f'    amplitude: float = number("how much of it there is", unit="{unit}")\n'
        return "{}", '{"amplitude": 1.0}', '{"amplitude": 0.0}', field, lookup
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
    return _plain(shapes), _plain(values), _plain(neutral), fields, f"        return {code}"


def _plain(values: dict[str, float]) -> str:
    return "{" + ", ".join(f'"{name}": {value!r}' for name, value in values.items()) + "}"


def _replaced(code: str, name: str) -> str:
    """`name` as an attribute of self, where it stands as a word of its own."""
    import re

    return re.sub(rf"(?<![\w.]){name}(?!\w)", f"self.{name}", code)
