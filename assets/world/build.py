"""The static world of a town, from the ground up."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from assets.mesh import Mesh
from assets.streets import Streets
from assets.world.borders.enclosures import enclose
from assets.world.borders.gardens import garden_borders
from assets.world.buildings.construction import buildings_mesh, entrances_mesh
from assets.world.buildings.given import given_buildings
from assets.world.buildings.houses import design
from assets.world.buildings.plots import lay_out
from assets.world.environment import Environment
from assets.world.furniture.furnishing import furnish
from assets.world.furniture.props import SignalHead, props_mesh
from assets.world.ground.plan import TERRAIN, terrain_materials
from assets.world.ground.sheet import Sheet
from assets.world.groundwork import lay_groundwork
from assets.world.obstacles import Obstacles
from assets.world.plants.greenery import climbers_mesh, hedgerow_trees, planted_trees, trees_mesh
from assets.world.roads.markings import repairs_mesh
from assets.world.styles import style_of


@dataclass(frozen=True, eq=False)
class BuiltWorld:
    """The static part of a town; world axes (x east, y north, z up), metres.

    Leaves, panes and pickets are single sheets: trace and draw them from both sides.

    Attributes:
        mesh: all surfaces.
        ground: ground surfaces: carriageway, kerbs, pavement and terrain, without markings.
        height: the sheet z = H(x, y), (n, 2) → (n,), on which the carriageway lies.
        bounds: (2, 2) lower and upper corner of the land, x and y.
        signals: heads of traffic signals, whose lamps are dark in the mesh.
        seats: (k, 4, 4) poses of the seats of benches, tables and bus shelters: on the ground below the hips of a
            person that sits, x ahead.
    """

    mesh: Mesh
    ground: Mesh
    height: Sheet
    bounds: np.ndarray
    signals: tuple[SignalHead, ...] = ()
    seats: np.ndarray = field(default_factory=lambda: np.zeros((0, 4, 4)))


def build_world(
    streets: Streets,
    seed: int,
    environment: Environment | None = None,
) -> BuiltWorld:
    """Builds the static world around a street network.

    The same streets and seed give byte-identical meshes; another seed gives other buildings, façades,
    plants and furniture along the same streets.

    Args:
        streets: the network and its style.
        seed: of every choice.
        environment: how densely it is built, planted and furnished; as the style has it by default.

    Raises:
        ValueError: the network has no lanes, or its style is unknown.
    """
    base = lay_groundwork(streets)
    streets = base.streets  # on the land; bridges carry the rest
    environment = environment or Environment()
    style = environment.dress(style_of(streets.style))
    rng = np.random.default_rng(seed)
    outlines, relief, edge = base.outlines, base.relief, base.edge
    ground = base.surfaced(terrain_materials(base.plan, style, base.town[0], base.town[1], rng))
    plots = [] if streets.defines_buildings else lay_out(base.paved, style, rng, base.open_roads)
    houses = design(plots, style, lambda xy: relief.z(xy, TERRAIN), rng)

    def stand_z(xy: np.ndarray) -> np.ndarray:
        return relief.z_of_land(xy, outlines.pavement)

    blocked = Obstacles(streets, outlines, base.paved, plots, base.decks)
    planted = planted_trees(streets.trees, blocked, stand_z, style, rng) if streets.trees else Mesh.empty()
    repairs = repairs_mesh(streets, outlines.carriageway, base.height, rng)
    walls = buildings_mesh(houses, rng)
    props, signals = props_mesh(streets, edge, blocked, stand_z, style, rng)
    furnishings, seats = furnish(edge, blocked, stand_z, style, environment, rng)
    parts = [
        ground,
        base.kerb_stones,
        base.markings,
        repairs,
        walls,
        props,
        furnishings,
        trees_mesh(edge, plots, base.bounds, blocked, stand_z, style, rng),
        entrances_mesh(houses, stand_z, rng),
        climbers_mesh(houses, stand_z, style.climbers, rng),
    ]
    gardens = garden_borders(houses, blocked, style, rng)
    if streets.defines_buildings:  # files with buildings have no hedges
        parts.append(given_buildings(streets.buildings, lambda xy: relief.z(xy, TERRAIN), style, rng))
    else:
        fronts, rows = enclose(streets, outlines, houses, gardens, blocked, style, rng)
        parts += [gardens.mesh(stand_z, rng), fronts.mesh(stand_z, rng)]
        parts.append(hedgerow_trees(rows, blocked, stand_z, style, rng))
    parts.append(planted)
    parts.append(base.bridges)
    return BuiltWorld(Mesh.merge(parts), ground, base.height, base.bounds, signals, seats)
