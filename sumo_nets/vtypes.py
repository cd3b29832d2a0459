"""Vehicle types: one for every body and size in the model catalogue, and cars of further sizes.

Meshes are scaled to the types' sizes, so that meshes and traffic agree.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np


class VehicleModel(Protocol):
    """The fields that this module reads of a catalogue entry (`assets.models.catalogue.ModelSpec`)."""

    @property
    def kind(self) -> str: ...  # noqa: D102
    @property
    def body(self) -> str: ...  # noqa: D102
    @property
    def length_m(self) -> float: ...  # noqa: D102
    @property
    def width_m(self) -> float: ...  # noqa: D102
    @property
    def height_m(self) -> float: ...  # noqa: D102


@dataclass(frozen=True)
class VType:
    """A SUMO vehicle type.

    Attributes:
        id: `body_LENGTHxWIDTHxHEIGHT`, metres.
        kind: kind of the catalogue models that it represents.
        body: their body.
        length_m, width_m, height_m: their size.
        models: how many of them there are.
    """

    id: str
    kind: str
    body: str
    length_m: float
    width_m: float
    height_m: float
    models: int


DRIVING = "driving"
PARKED = "parked"
WALKING = "walking"

_LONGEST_PARKED_M = 5.7

# Sizes of cars that a catalogue car represents, over its own length, width and height; wide ones are rather long and
# tall. With the shares of the bodies they give 4.14 ± 0.46 × 1.70 ± 0.11 × 1.56 ± 0.13 m, and scans in which cars are
# as long, wide and high as in KITTI's scans. The boxes of KITTI's labels are smaller (sensors/annotators/kitti.yaml).
_AS_IT_IS = (1.0, 1.0, 1.0)
_CAR_FORMS = (
    (0.95, 0.95, 0.98),
    _AS_IT_IS,
    (1.02, 1.05, 1.12),
    (1.06, 1.00, 0.99),
    (1.10, 1.07, 1.14),
    (1.15, 1.11, 1.03),
)
_CAR_BODIES = {"hatchback": 0.56, "saloon": 0.13, "estate": 0.15, "suv": 0.16}

# Shares of the kinds, in vehicles seen on a town's streets.
_SHARES: dict[str, dict[str, float]] = {
    DRIVING: {"car": 0.80, "van": 0.08, "truck": 0.025, "bus": 0.01, "motorcycle": 0.03, "cyclist": 0.055},
    PARKED: {"car": 0.93, "van": 0.07},
    WALKING: {"pedestrian": 1.0},
}

# Car following [m/s², s, m]; speedFactor is the share of the limit a driver wants to go.
_BEHAVIOUR: dict[str, str] = {
    "car": 'vClass="passenger" accel="1.6" decel="3.5" sigma="0.5" tau="1.2" minGap="2.0" '
    'speedFactor="normc(1.00,0.10,0.75,1.30)"',
    "van": 'vClass="delivery" accel="1.5" decel="3.5" sigma="0.5" tau="1.3" minGap="2.2" '
    'speedFactor="normc(0.98,0.09,0.75,1.25)"',
    "truck": 'vClass="truck" accel="1.0" decel="4.0" sigma="0.4" tau="1.5" minGap="2.5" '
    'speedFactor="normc(0.92,0.06,0.75,1.05)"',
    "bus": 'vClass="bus" accel="1.0" decel="4.0" sigma="0.4" tau="1.5" minGap="2.5" '
    'speedFactor="normc(0.92,0.06,0.75,1.05)"',
    "tram": 'vClass="tram" accel="1.0" decel="2.0" sigma="0.2" tau="1.5" minGap="3.0" '
    'speedFactor="normc(0.90,0.03,0.80,1.00)"',
    "motorcycle": 'vClass="motorcycle" accel="2.6" decel="6.0" sigma="0.5" tau="1.0" minGap="1.8" '
    'speedFactor="normc(1.05,0.10,0.80,1.40)"',
    "cyclist": 'vClass="bicycle" accel="1.2" decel="3.0" sigma="0.5" tau="1.0" minGap="0.8" '
    'desiredMaxSpeed="5.0" speedFactor="normc(1.00,0.15,0.60,1.40)"',
    "pedestrian": 'vClass="pedestrian" desiredMaxSpeed="1.35" speedFactor="normc(1.00,0.15,0.60,1.50)"',
}

_GUI_SHAPES = {"van": "delivery", "truck": "truck", "bus": "bus", "tram": "rail/railcar", "motorcycle": "motorcycle"}
_GUI_SHAPES |= {"cyclist": "bicycle", "pedestrian": "pedestrian"}
_CAR_SHAPES = {"hatchback": "passenger/hatchback", "sedan": "passenger/sedan", "saloon": "passenger/sedan"}
_CAR_SHAPES |= {"estate": "passenger/wagon", "wagon": "passenger/wagon"}


def make_vtypes(models: Iterable[VehicleModel]) -> tuple[VType, ...]:
    """Return one vehicle type per body and size, ordered by id; of cars, six sizes around each model's own.

    Models of kinds that SUMO does not simulate (persons that sit) have none.
    """
    counts: Counter[tuple[str, str, float, float, float]] = Counter()
    for m in models:
        if m.kind not in _BEHAVIOUR:
            continue
        for form in _CAR_FORMS if m.kind == "car" else (_AS_IT_IS,):
            size = np.round(np.multiply((m.length_m, m.width_m, m.height_m), form), 2 if form != _AS_IT_IS else 3)
            counts[(m.kind, m.body, *size.tolist())] += 1
    types = [
        VType(vtype_id(body, *size), kind, body, *size, models=number) for (kind, body, *size), number in counts.items()
    ]
    return tuple(sorted(types, key=lambda t: t.id))


def vtype_id(body: str, length_m: float, width_m: float, height_m: float) -> str:
    """Return the id of the vehicle type of a body and size."""
    return f"{body}_{length_m:.2f}x{width_m:.2f}x{height_m:.2f}"


def write_vtypes(types: Iterable[VType]) -> list[str]:
    """Return the lines of an additional file: the types, then the distributions `driving`, `parked`, `walking`."""
    types = list(types)
    lines = []
    for t in types:
        size = f'length="{t.length_m:.3f}" width="{t.width_m:.3f}" height="{t.height_m:.3f}"'
        shape = _CAR_SHAPES.get(t.body, "passenger") if t.kind == "car" else _GUI_SHAPES[t.kind]
        lines.append(f'    <vType id="{t.id}" {size} guiShape="{shape}" {_BEHAVIOUR[t.kind]}/>')
    return lines + [_distribution(name, types) for name in _SHARES]


def _distribution(name: str, types: list[VType]) -> str:
    shares = _SHARES[name]
    fits = [t for t in types if t.kind in shares and not (name == PARKED and t.length_m > _LONGEST_PARKED_M)]
    models = Counter[str]()
    for t in fits:
        models[_group(t)] += t.models
    bodies = sum(_CAR_BODIES.get(body, 1.0) for body in {t.body for t in fits if t.kind == "car"})
    within = {t.id: t.models / models[_group(t)] for t in fits}
    within |= {t.id: within[t.id] * _CAR_BODIES.get(t.body, 1.0) / bodies for t in fits if t.kind == "car"}
    chances = " ".join(f"{shares[t.kind] * within[t.id]:.5f}" for t in fits)
    return f'    <vTypeDistribution id="{name}" vTypes="{" ".join(t.id for t in fits)}" probabilities="{chances}"/>'


def _group(t: VType) -> str:
    """Group of models among which a kind's share is divided evenly: by body for cars, else all of the kind."""
    return t.body if t.kind == "car" else t.kind
