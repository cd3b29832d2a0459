"""Families of functions of one variable, as functions, as Python code and as text."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sensors.effects.covariates import wrapped

Parameters = dict[str, float]
MOST_POWER = 10.0  # largest exponent of a power; higher ones imitate steps and overflow outside the fitted range


@dataclass(frozen=True)
class Family:
    """A family of functions.

    Attributes:
        name: of the family.
        function: of x and its parameters, by name.
        code: the same as Python, in braces `x` and the parameters.
        text: the same as people write it.
        free: parameters that fits may change.
        fixed: further parameters, which stay.
        is_slope: whether the function has the unit of x, so that the amplitude is per that unit.
    """

    name: str
    function: Callable[..., np.ndarray]
    code: str
    text: str
    free: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    is_slope: bool = False


_ALL = (
    Family("constant", lambda x: np.ones_like(x), "np.ones_like({x})", "1"),
    Family("linear", lambda x: x, "{x}", "{x}", is_slope=True),
    Family("ramp", lambda x, start: x - start, "({x} - {start})", "({x} − {start})", fixed=("start",), is_slope=True),
    Family("inverse", lambda x: 1 / np.maximum(x, 1e-3), "(1 / np.maximum({x}, 1e-3))", "1/{x}"),
    Family("logarithm", lambda x: np.log(np.maximum(x, 1e-3)), "np.log(np.maximum({x}, 1e-3))", "ln {x}"),
    Family(
        "power",
        lambda x, power: np.maximum(x, 1e-3) ** power,
        "np.maximum({x}, 1e-3) ** {power}",
        "{x}^{power}",
        ("power",),
    ),
    Family(
        "decay",
        lambda x, start, length: np.exp(-np.maximum(x - start, 0) / length),
        "np.exp(-np.maximum({x} - {start}, 0) / {length})",
        "exp(−({x} − {start})/{length})",
        ("length",),
        ("start",),
    ),
    Family(
        "growth",
        lambda x, end, length: np.exp(np.minimum(x - end, 0) / length),
        "np.exp(np.minimum({x} - {end}, 0) / {length})",
        "exp(({x} − {end})/{length})",
        ("length",),
        ("end",),
    ),
    Family(
        "bell",
        lambda x, centre, width: np.exp(-(((x - centre) / width) ** 2)),
        "np.exp(-((({x} - {centre}) / {width}) ** 2))",
        "exp(−(({x} − {centre})/{width})²)",
        ("centre", "width"),
    ),
    Family(
        "cyclic bell",
        lambda x, centre, width, period: np.exp(-((wrapped(x - centre, period) / width) ** 2)),
        "np.exp(-((wrapped({x} - {centre}, {period}) / {width}) ** 2))",
        "exp(−(({x} − {centre})/{width})²)",
        ("centre", "width"),
        ("period",),
    ),
    Family("step", lambda x, edge: (x > edge) * 1.0, "({x} > {edge}) * 1.0", "[{x} > {edge}]", ("edge",)),
    Family(
        "hinge",
        lambda x, edge: np.maximum(x - edge, 0),
        "np.maximum({x} - {edge}, 0)",
        "max(0, {x} − {edge})",
        ("edge",),
        is_slope=True,
    ),
    Family(
        "hinge below",
        lambda x, edge: np.maximum(edge - x, 0),
        "np.maximum({edge} - {x}, 0)",
        "max(0, {edge} − {x})",
        ("edge",),
        is_slope=True,
    ),
    Family(
        "window",
        lambda x, start, end: ((x > start) & (x <= end)) * 1.0,
        "(({x} > {start}) & ({x} <= {end})) * 1.0",
        "[{start} < {x} ≤ {end}]",
        ("start", "end"),
    ),
    Family(
        "sector",
        lambda x, start, width, period: (np.mod(x - start, period) < width) * 1.0,
        "(np.mod({x} - {start}, {period}) < {width}) * 1.0",
        "[{x} from {start} to {stop}]",
        ("start", "width"),
        ("period",),
    ),
    Family(
        "sine",
        lambda x, wave, shift: np.sin(wave * x + shift),
        "np.sin({wave} * {x} + {shift})",
        "sin({wave}·{x} + {shift})",
        ("wave", "shift"),
    ),
    Family(
        "harmonic",
        lambda x, wave, shift: np.sin(wave * x + shift),
        "np.sin({wave} * {x} + {shift})",
        "sin({wave}·{x} + {shift})",
        ("shift",),
        ("wave",),
    ),
    Family(
        "sawtooth",
        lambda x, start, tooth: np.mod((x - start) / tooth, 1.0) - 0.5,
        "(np.mod(({x} - {start}) / {tooth}, 1.0) - 0.5)",
        "(frac(({x} − {start})/{tooth}) − ½)",
        ("start",),
        ("tooth",),
    ),
)
FAMILIES: dict[str, Family] = {family.name: family for family in _ALL}
