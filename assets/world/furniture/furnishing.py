"""Furnishes the pavements: so many props of every kind on 100 m of sidewalk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from assets.mesh import Mesh
from assets.world.environment import Environment
from assets.world.furniture import roadside, street_furniture, street_life
from assets.world.furniture.lines import overhead_lines
from assets.world.ground.overlays import Heights
from assets.world.instancing import instances, poses
from assets.world.obstacles import Obstacles
from assets.world.roads.kerbside import Kerbside
from assets.world.styles import TownStyle

_VARIANTS = 3
_TRIES = 4  # places looked at for every prop wanted
_NARROWEST_M = 0.8  # pavement that counts as one
_BUSY_SHOP_SHARE = 0.2


@dataclass(frozen=True)
class _Prop:
    """Construction and placement of a kind of prop.

    Attributes:
        make: gives a template.
        busy, quiet: usual density in streets with and without shops, per 100 m of sidewalk.
        place: at the kerb, at the back of the pavement, at the kerb of corners, or behind the pavement.
        radius_m: room it takes.
        pavement_m: minimum width of the pavement.
        seats: where persons can sit on it.
    """

    make: Callable[[np.random.Generator], Mesh]
    busy: float
    quiet: float
    place: Literal["kerb", "back", "corner", "behind"]
    radius_m: float
    pavement_m: float = 1.2
    seats: tuple[street_furniture.Seat, ...] = ()


_PROPS: dict[str, _Prop] = {
    "bus_stop": _Prop(
        lambda _: street_furniture.bus_shelter(), 0.10, 0.06, "behind", 2.3, seats=street_furniture.SHELTER_SEATS
    ),
    "market_stall": _Prop(street_life.market_stall, 0.18, 0.0, "back", 1.4, 3.3),
    "table": _Prop(lambda _: street_life.cafe_table(), 0.5, 0.02, "back", 1.0, 2.9, street_life.TABLE_SEATS),
    "litter_bin": _Prop(lambda _: street_furniture.litter_bin(), 0.9, 0.5, "kerb", 0.3),
    "hydrant": _Prop(lambda _: street_furniture.hydrant(), 0.4, 0.3, "kerb", 0.25),
    "cabinet": _Prop(lambda rng: street_furniture.cabinet(float(rng.uniform(0.7, 1.5))), 0.5, 0.3, "back", 0.6),
    "bench": _Prop(lambda _: street_furniture.bench(), 0.6, 0.2, "back", 0.8, seats=street_furniture.BENCH_SEATS),
    "parking_meter": _Prop(lambda _: street_furniture.parking_meter(), 0.5, 0.15, "kerb", 0.2),
    "wheelie_bin": _Prop(lambda _: street_furniture.wheelie_bin(), 0.7, 0.9, "back", 0.35),
    "box": _Prop(street_life.boxes, 0.4, 0.15, "back", 0.7),
    "planter": _Prop(street_life.planter, 0.7, 0.15, "back", 0.45),
    "bicycle": _Prop(street_life.parked_bicycle, 0.8, 0.25, "back", 0.75),
    "fence": _Prop(lambda _: street_life.guard_rail(), 0.25, 0.1, "kerb", 2.0),
    "bollard": _Prop(lambda _: street_furniture.bollard(), 0.6, 0.15, "corner", 0.5),
    "trailer": _Prop(roadside.trailer, 0.08, 0.15, "behind", 2.0),
    "skip": _Prop(roadside.skip, 0.06, 0.06, "behind", 2.0),
    "glass_bank": _Prop(roadside.glass_banks, 0.06, 0.05, "behind", 2.0),
    "barrier": _Prop(roadside.barrier, 0.2, 0.08, "kerb", 2.0, 1.6),
    "scooter": _Prop(roadside.scooter, 0.5, 0.1, "back", 0.75),
    "advertising_pillar": _Prop(lambda _: roadside.advertising_pillar(), 0.12, 0.0, "back", 0.8, 2.6),
}


def furnish(
    edge: Kerbside, blocked: Obstacles, stand_z: Heights, style: TownStyle, environment: Environment,
    rng: np.random.Generator,
) -> tuple[Mesh, np.ndarray]:  # fmt: skip
    """Overhead lines and loose props of the pavements; `stand_z` gives the height of whatever ground is at a point.

    Returns:
        The mesh, and the poses (k, 4, 4) of the seats: on the ground below the hips of a person that sits, x ahead.
    """
    walkable_m = float(np.count_nonzero(edge.pavement_m > _NARROWEST_M))  # a point a metre
    busy = style.shop_share > _BUSY_SHOP_SHARE
    poles = environment.density("utility_pole", 0.2 if busy else 0.8)
    seats: list[np.ndarray] = [np.zeros((0, 4, 4))]
    parts = [overhead_lines(edge, blocked, stand_z, int(rng.poisson(poles * walkable_m / 100)), rng)]
    for kind, prop in _PROPS.items():
        density = environment.density(kind, prop.busy if busy else prop.quiet)
        wanted = int(rng.poisson(density * walkable_m / 100))
        rows = rng.permutation(np.flatnonzero(_suits(prop, edge)))[: wanted * _TRIES]
        templates = [prop.make(rng) for _ in range(_VARIANTS)]
        mesh, placed = _stand(templates, rows, prop, wanted, edge, blocked, stand_z)
        parts.append(mesh)
        seats += [placed @ pose for pose in _seat_poses(prop.seats)]
    return Mesh.merge(parts), np.concatenate(seats)


def _seat_poses(seats: tuple[street_furniture.Seat, ...]) -> np.ndarray:
    """Poses (k, 4, 4) of seats in the axes of their template."""
    x, y, view_deg = np.array(seats).reshape(-1, 3).T
    return poses(np.column_stack([x, y, np.zeros(len(x))]), np.radians(view_deg))


def _suits(prop: _Prop, edge: Kerbside) -> np.ndarray:
    wide = edge.pavement_m > prop.pavement_m
    if prop.place == "corner":
        return wide & (edge.junction_m < 2.5)
    return wide & (edge.junction_m > (15.0 if prop.place == "behind" else 3.0 + prop.radius_m))


def _stand(
    templates: list[Mesh], rows: np.ndarray, prop: _Prop, wanted: int, edge: Kerbside, blocked: Obstacles,
    stand_z: Heights,
) -> tuple[Mesh, np.ndarray]:  # fmt: skip
    """Copies of the templates at the first rows, up to a number, where there is room; and their poses (k, 4, 4)."""
    depth = {
        "kerb": np.full(len(rows), 0.4),
        "corner": np.full(len(rows), 0.3),
        "back": np.maximum(edge.pavement_m[rows] - min(0.3 + 0.3 * prop.radius_m, 0.75), 0.5),
        "behind": edge.pavement_m[rows] + 1.2,
    }[prop.place]
    spots = edge.point[rows] + edge.outward[rows] * depth[:, None]
    if prop.place == "behind":
        keep = blocked.free(spots, prop.radius_m, road_m=1.0, paved_m=0.9)
    else:
        keep = blocked.free(spots, min(prop.radius_m, 0.5 if prop.radius_m < 0.9 else 0.8), road_m=0.2)
    rows, spots = rows[keep], spots[keep]
    taken = blocked.take(spots, prop.radius_m, most=wanted)
    rows, spots = rows[taken], spots[taken]
    placed = poses(np.column_stack([spots, stand_z(spots)]), edge.yaw_rad[rows])
    which = np.arange(len(rows)) % len(templates)
    return Mesh.merge([instances(template, placed[which == k]) for k, template in enumerate(templates)]), placed
