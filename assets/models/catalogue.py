"""The catalogue of parametric models: names, kinds and dimensions of all road users."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal["car", "van", "truck", "bus", "tram", "motorcycle", "cyclist", "pedestrian", "person_sitting"]
Body = Literal[
    "hatchback",
    "saloon",
    "estate",
    "suv",
    "van",
    "truck",
    "bus",
    "tram",
    "motorcycle",
    "bicycle",
    "pedestrian",
    "person_sitting",
]


@dataclass(frozen=True)
class ModelSpec:
    """Dimensions of one model, in the model's frame: x forward, y left, z up, origin below the box centre.

    Attributes:
        name: catalogue key, `BODY_NN`.
        kind: class of road user.
        body: body style.
        length_m: full length of the box.
        width_m: full width of the box, mirrors included.
        height_m: full height of the box.
        wheelbase_m: distance of the axles (of the bogies of a tram); 0 for people.
        front_axle_x_m: position of the front axle.
        rear_axle_x_m: position of the rear axle (of the rearmost axle group).
        track_m: distance between the wheel centres of an axle; 0 for single-track vehicles.
        variant: shape variant; variants of one size share every dimension.
    """

    name: str
    kind: Kind
    body: Body
    length_m: float
    width_m: float
    height_m: float
    wheelbase_m: float
    front_axle_x_m: float
    rear_axle_x_m: float
    track_m: float
    variant: int

    @property
    def size_m(self) -> tuple[float, float, float]:
        """Length, width and height of the box."""
        return self.length_m, self.width_m, self.height_m


# body: kind, shape variants, then one row a size: length, width, height, front overhang, wheelbase, track (m)
_SIZES: dict[Body, tuple[Kind, int, tuple[tuple[float, ...], ...]]] = {
    "hatchback": (
        "car",
        2,
        (
            (3.42, 1.55, 1.48, 0.66, 2.30, 1.29),
            (3.70, 1.61, 1.47, 0.72, 2.43, 1.35),
            (4.02, 1.67, 1.46, 0.80, 2.56, 1.40),
        ),
    ),
    "saloon": ("car", 2, ((4.18, 1.66, 1.42, 0.80, 2.50, 1.39), (4.55, 1.74, 1.43, 0.83, 2.70, 1.46))),
    "estate": ("car", 2, ((4.12, 1.66, 1.47, 0.80, 2.50, 1.39), (4.52, 1.73, 1.48, 0.83, 2.68, 1.45))),
    "suv": ("car", 2, ((3.85, 1.66, 1.66, 0.76, 2.42, 1.38), (4.38, 1.78, 1.68, 0.84, 2.63, 1.49))),
    "van": ("van", 2, ((4.75, 1.85, 1.95, 0.88, 2.92, 1.55), (5.39, 1.95, 2.45, 0.95, 3.30, 1.64))),
    "truck": ("truck", 2, ((8.30, 2.50, 3.12, 1.25, 4.60, 2.05), (11.90, 2.60, 3.45, 1.35, 7.00, 2.10))),
    "bus": ("bus", 2, ((12.00, 2.55, 3.10, 2.70, 5.90, 2.12),)),
    "tram": ("tram", 2, ((15.00, 2.40, 3.40, 3.40, 8.20, 1.435),)),
    "motorcycle": ("motorcycle", 2, ((2.10, 0.82, 1.66, 0.32, 1.42, 0.0),)),
    "bicycle": ("cyclist", 3, ((1.76, 0.60, 1.74, 0.34, 1.08, 0.0),)),
    "pedestrian": (
        "pedestrian",
        2,
        (
            (0.76, 0.60, 1.63, 0.38, 0.0, 0.0),
            (0.84, 0.66, 1.76, 0.42, 0.0, 0.0),
            (0.92, 0.70, 1.87, 0.46, 0.0, 0.0),
        ),
    ),
    "person_sitting": ("person_sitting", 2, ((0.80, 0.54, 1.28, 0.40, 0.0, 0.0), (0.84, 0.58, 1.36, 0.42, 0.0, 0.0))),
}


def _specs() -> list[ModelSpec]:
    specs = []
    for body, (kind, variants, sizes) in _SIZES.items():
        rows = [(size, variant) for size in sizes for variant in range(variants)]
        for number, (size, variant) in enumerate(rows, start=1):
            length, width, height, overhang, wheelbase, track = size
            front = round(length / 2 - overhang, 4)
            rear = round(front - wheelbase, 4)
            specs.append(
                ModelSpec(
                    name=f"{body}_{number:02d}",
                    kind=kind,
                    body=body,
                    length_m=length,
                    width_m=width,
                    height_m=height,
                    wheelbase_m=wheelbase,
                    front_axle_x_m=front,
                    rear_axle_x_m=rear,
                    track_m=track,
                    variant=variant,
                )
            )
    return specs


CATALOGUE: dict[str, ModelSpec] = {spec.name: spec for spec in _specs()}


def model_spec(name: str) -> ModelSpec:
    """Catalogue entry of a model.

    Raises:
        KeyError: no model has this name.
    """
    try:
        return CATALOGUE[name]
    except KeyError:
        raise KeyError(f"model {name!r} is not in the catalogue; names run from 'hatchback_01'") from None
