"""Effects of every simple form: a channel, its covariates, a size and a shape, all drawn from a seed.

A form is a weight (n,) of beams, about −1…1 (0…1 for losses), times a size, in a channel: metres added to the range,
a relative change of the intensity, or a probability of loss. `noise_shape` has no weight: it is a noise distribution.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tests.hidden.columns import COLUMNS, firing, incidence, kind, made_of, measured_intensity, neighbour
from tests.hidden.scan import Scan
from tests.hidden.truth import Finding
from tests.hidden.unseen.kind import Kind, NotApplicableError, Parameters, World, amplitude, pick, uniform

Weight = Callable[[Scan, np.random.Generator, Parameters], np.ndarray]

_QUANTITIES = {"range": "range_m", "intensity": "intensity", "drop": "loss"}
_CHANNELS = ("range", "intensity", "drop")
_PER_LASER = {"range": ("ring_range_offset",), "intensity": ("ring_gain",), "drop": ()}


def _form(
    draw: Callable[[np.random.Generator, str, World], dict[str, Any]],
    weight: Weight,
    finding: Callable[[Parameters], Finding],
    late: Callable[[Parameters], bool] = lambda p: False,
    is_random: bool = False,
) -> Kind:
    """A kind of effect from a weight; `late` ones act on what is measured, after detection."""

    def act(scan: Scan, rng: np.random.Generator, p: Parameters) -> None:
        value = p["size"] * weight(scan, rng, p)
        if p["channel"] == "range":
            scan.range_m += value
        elif p["channel"] == "intensity":
            scan.intensity *= np.maximum(1 + value, 0.05)
        else:
            scan.found &= rng.random(len(scan.found)) >= value

    def stage(p: Parameters) -> str:
        if p["channel"] == "range":
            return "range"
        return "detected" if late(p) or p["channel"] == "drop" else "signal"

    return Kind(draw, lambda p, world: (finding(p),), stage, act, lambda p: is_random or p["channel"] == "drop")


def _sized(rng: np.random.Generator, channel: str, level: str, signed: bool = True) -> dict[str, Any]:
    return {"channel": channel, "size": amplitude(rng, level, _QUANTITIES[channel], signed and channel != "drop")}


# One covariate. Shapes that a catalogue effect has (a straight line in range, a fall over range) are left out.
_HUMPS, _ALL = ("bell", "step"), ("bell", "step", "ramp", "saturating")
_SHAPES_OF = {
    **{(channel, name): _ALL for channel in _CHANNELS for name in ("elevation", "ring", "previous_intensity")},
    **{(channel, "azimuth"): ("bell", "step", "ramp") for channel in _CHANNELS},
    **{(channel, name): _HUMPS for channel in _CHANNELS for name in ("range", "incidence", "albedo")},
    ("range", "intensity"): _HUMPS,
}


def _draw_one(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    channel = pick(rng, _CHANNELS)
    covariate = pick(rng, [name for where, name in _SHAPES_OF if where == channel])
    shape = pick(rng, _SHAPES_OF[channel, covariate])
    where = {"covariate": covariate, "shape": shape, "centre": uniform(rng, 0.25, 0.7)}
    return _sized(rng, channel, level) | where | {"width": uniform(rng, 0.1, 0.25)}


def _weight_one(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    x = np.clip(COLUMNS[p["covariate"]].unit(scan), 0, 1)
    if p["shape"] == "bell":
        return np.exp(-(((x - p["centre"]) / p["width"]) ** 2))
    if p["shape"] == "step":
        return (x > p["centre"]).astype(float)
    if p["shape"] == "ramp":
        return x if p["channel"] == "drop" else 2 * x - 1
    return 1 - np.exp(-x / p["width"])


def _finding_one(p: Parameters) -> Finding:
    by_laser = _PER_LASER[p["channel"]] if p["covariate"] in ("ring", "elevation") else ()
    return Finding((p["channel"],), (COLUMNS[p["covariate"]].accepted,), by_laser)


# A pair: a product of two centred functions, so that a single one does not change the mean.
def _log_range(scan: Scan) -> np.ndarray:
    return np.tanh(np.log(np.maximum(scan.range_m, 0.1) / 8.5) / 0.8)


_CENTRED: dict[str, Callable[[Scan], np.ndarray]] = {
    "range": _log_range,
    "incidence": lambda scan: np.clip((incidence(scan) - 1.03) / 0.5, -1, 1),
    "ring": lambda scan: 2 * (scan.beams.ring + 0.5) / scan.beams.rings - 1,
    "albedo": lambda scan: np.clip((scan.rho - 0.35) / 0.3, -1, 1),
}
_PAIRS = (
    ("range", "azimuth"),
    ("incidence", "azimuth"),
    ("ring", "azimuth"),
    ("albedo", "azimuth"),
    ("range", "albedo"),
)


def _draw_pair(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    first, second = pick(rng, _PAIRS)
    turn = {"waves": int(rng.integers(1, 4)), "phase_deg": uniform(rng, 0, 360)} if second == "azimuth" else {}
    size = _sized(rng, pick(rng, ("range", "intensity")), level)
    # A product of two is small for most beams: twice the size moves them as much as one covariate does.
    return size | {"size": 2 * size["size"], "first": first, "second": second} | turn


def _weight_pair(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    first = _CENTRED[p["first"]](scan)
    if p["second"] == "azimuth":
        return first * np.sin(p["waves"] * scan.beams.azimuth + np.radians(p["phase_deg"]))
    return first * _CENTRED[p["second"]](scan)


def _finding_pair(p: Parameters) -> Finding:
    return Finding((p["channel"],), (COLUMNS[p["first"]].accepted, COLUMNS[p["second"]].accepted))


# Neighbours: what they measured, or that they measured nothing.
_LOOKS = {
    ("above_intensity", "range"): ("above_intensity",),
    ("above_intensity", "intensity"): ("above_intensity",),
    ("above_intensity", "drop"): ("above_intensity",),
    ("below_intensity", "range"): ("below_intensity",),
    ("below_intensity", "intensity"): ("below_intensity",),
    ("previous_intensity", "intensity"): ("previous_intensity",),
    ("previous_intensity", "drop"): ("previous_intensity",),
    ("above_range", "range"): ("above_range",),
    ("previous_range", "range"): ("previous_range",),
    ("previous_lost", "drop"): ("previous_lost", "neighbour_lost", "previous_range", "previous_intensity"),
    ("previous_lost", "intensity"): ("previous_lost", "neighbour_lost", "previous_range", "previous_intensity"),
    ("neighbour_lost", "drop"): ("neighbour_lost", "above_range", "above_intensity", "below_intensity"),
}


def _draw_neighbour(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    look, channel = pick(rng, list(_LOOKS))
    return _sized(rng, channel, level) | {"look": look}


def _weight_neighbour(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    which, what = p["look"].split("_")
    if what == "intensity":
        light = neighbour(scan, measured_intensity(scan), which, 0.0)
        return np.minimum(light / 0.5, 1.5)
    lost = (~scan.found).astype(float)
    if what == "lost":
        if which == "previous":
            return neighbour(scan, lost, "previous", 0.0)
        return np.maximum(neighbour(scan, lost, "above", 0.0), neighbour(scan, lost, "below", 0.0))
    measured = np.where(scan.found, scan.range_m, np.nan)
    step_m = 1.0 if which == "above" else 0.1  # rings lie metres apart on the ground, firings centimetres
    return np.nan_to_num(np.tanh((neighbour(scan, measured, which, np.nan) - scan.range_m) / step_m))


def _finding_neighbour(p: Parameters) -> Finding:
    return Finding((p["channel"],), (_LOOKS[p["look"], p["channel"]],))


# A class of road user, or a material.
CLASSES = {
    "cars": ("car", "van", "truck", "bus"),
    "people": ("pedestrian", "cyclist", "motorcycle"),
}
_FEWEST_OBJECTS, _FEWEST_BEAMS, _FEWEST_SHARE = 4, 150, 0.02
_OF_MATERIAL = ("material", "albedo", "model")
_OF_CLASS = ("class", "kind", "model", "instance", "material")


def _draw_class(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    channel = pick(rng, _CHANNELS)
    types = world.kinds(_FEWEST_OBJECTS, _FEWEST_BEAMS)
    where: list[dict[str, Any]] = [{"material": pick(rng, world.materials(_FEWEST_SHARE, 0.7))}]
    where += [{"objects": name} for name, members in CLASSES.items() if set(members) & set(types)]
    return _sized(rng, channel, level) | pick(rng, where)


def _weight_class(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    if "material" in p:
        return made_of(scan, (p["material"],)).astype(float)
    return np.isin(kind(scan), CLASSES[p["objects"]]).astype(float)


def _finding_class(p: Parameters) -> Finding:
    names = _OF_CLASS if "objects" in p else _OF_MATERIAL
    if p.get("material") == "car_paint":
        names = (*_OF_MATERIAL, "class", "kind", "instance")
    return Finding((p["channel"],), (names,))


# Periodic: along the firings of a revolution, or in time.
def _draw_periodic(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    channel = pick(rng, ("drop", "range", "intensity"))
    size = _sized(rng, channel, level, signed=False)
    if channel != "drop" and rng.random() < 0.5:
        return size | {"of": "time", "period_s": uniform(rng, 2.3, 9.0), "phase_deg": uniform(rng, 0, 360)}
    return size | {"of": "firing", "period": uniform(rng, 8, 40), "duty": uniform(rng, 0.2, 0.4)}


def _weight_periodic(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    if p["of"] == "time":
        time_s = scan.elapsed_s + scan.beams.time_s
        return np.sin(2 * np.pi * time_s / p["period_s"] + np.radians(p["phase_deg"]))
    turn = firing(scan) / p["period"]
    if p["channel"] == "drop":
        return (np.mod(turn, 1) < p["duty"]).astype(float)
    return np.sin(2 * np.pi * turn)


def _finding_periodic(p: Parameters) -> Finding:
    if p["of"] == "time":
        return Finding((p["channel"],), (("frame_time", "time", "phase", "scan"),))
    return Finding((p["channel"],), (("phase", "azimuth", "firing_time"),))


# A level of its own for each scan.
def _draw_scan(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    return _sized(rng, pick(rng, _CHANNELS), level, signed=False) | {"seed": int(rng.integers(1 << 30))}


def _weight_scan(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    of_scan = np.random.default_rng([p["seed"], round(scan.elapsed_s * 100)])
    level = of_scan.uniform(0, 1.5) if p["channel"] == "drop" else of_scan.normal()
    return np.full(len(scan.found), level)


def _finding_scan(p: Parameters) -> Finding:
    return Finding((p["channel"],), (("scan", "frame_time"),))


# The noise's shape, at the variance that the model has.
_LAWS = ("two_humps", "skewed", "uniform")
_SHARES = {"quarter": (0.3, 0.4), "half": (0.55, 0.65), "one": (0.7, 0.8), "strong": (0.85, 0.95)}


def _draw_noise(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    return {
        "channel": pick(rng, ("range", "intensity")),
        "law": pick(rng, _LAWS),
        "share": uniform(rng, *_SHARES[level]),
        "mirrored": bool(rng.random() < 0.5),
        "size": 0.0,
    }


def noise_law(p: Parameters, base: Callable) -> Callable[[np.random.Generator, int], np.ndarray]:
    """Distribution of mean 0 and variance 1, of which `share` has the shape and the rest is `base`."""

    def shaped(rng: np.random.Generator, n: int) -> np.ndarray:
        if p["law"] == "two_humps":
            x = rng.choice([-1.0, 1.0], n)
        elif p["law"] == "skewed":
            x = rng.exponential(size=n) - 1
        else:
            x = rng.uniform(-(3**0.5), 3**0.5, n)
        x = -x if p["mirrored"] else x
        return p["share"] ** 0.5 * x + (1 - p["share"]) ** 0.5 * base(rng, n)

    return shaped


def _finding_noise(p: Parameters) -> Finding:
    return Finding((p["channel"], f"{p['channel']}_variance"), (("noise_shape",),))


# Porous surfaces: the return comes from somewhere behind the first blade. Of leaves the catalogue knows that.
_POROUS = (("grass",), ("grass", "soil"), ("grass", "gravel"))


def _draw_porous(rng: np.random.Generator, level: str, world: World) -> dict[str, Any]:
    if world.share(lambda scan: made_of(scan, ("grass",))) < _FEWEST_SHARE:
        raise NotApplicableError
    size = _sized(rng, "range", level, signed=False)
    return size | {"materials": list(pick(rng, _POROUS))}


def _weight_porous(scan: Scan, rng: np.random.Generator, p: Parameters) -> np.ndarray:
    return made_of(scan, tuple(p["materials"])) * rng.exponential(size=len(scan.found))


def _finding_porous(p: Parameters) -> Finding:
    return Finding(("range", "range_variance"), ((*_OF_MATERIAL, "class"),))


FORMS: dict[str, Kind] = {
    "one_covariate": _form(_draw_one, _weight_one, _finding_one),
    "pair": _form(_draw_pair, _weight_pair, _finding_pair),
    "neighbours": _form(_draw_neighbour, _weight_neighbour, _finding_neighbour, lambda p: p["look"].endswith("lost")),
    "class_or_material": _form(_draw_class, _weight_class, _finding_class),
    "periodic": _form(_draw_periodic, _weight_periodic, _finding_periodic),
    "scan_level": _form(_draw_scan, _weight_scan, _finding_scan),
    "noise_shape": Kind(_draw_noise, lambda p, world: (_finding_noise(p),), lambda p: "law", noise_law),
    "porous": _form(_draw_porous, _weight_porous, _finding_porous, is_random=True),
}
