"""The part that all worlds of a town share: terrain, roads and kerbs. It takes longest to build."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Geometry

from assets.cache import cached
from assets.mesh import Mesh
from assets.streets import Streets
from assets.world.ground.height_field import fit_height_field
from assets.world.ground.plan import CARRIAGEWAY, TERRAIN, SurfacePlan, triangulate
from assets.world.ground.relief import TerrainRelief, ground_mesh, kerb_stones
from assets.world.ground.sheet import Sheet
from assets.world.ground.unevenness import unevenness
from assets.world.roads.bridges import decks_mesh, split_levels
from assets.world.roads.kerbside import Kerbside, kerbside
from assets.world.roads.markings import markings_mesh
from assets.world.roads.surfaces import Outlines, open_roads, outline
from assets.world.roads.tracks import tracks_mesh

_MARGIN_M = 120.0  # land beyond the streets


@dataclass(frozen=True, eq=False)
class Groundwork:
    """The part of a town's worlds that does not depend on the seed; world axes, metres.

    Attributes:
        streets: the network, without what bridges carry.
        town: (2, 2) lower and upper corner of the streets, x and y.
        bounds: (2, 2) the same of the land.
        height: the sheet that everything lies on: the smooth surface, uneven as ground is.
        outlines: what is paved.
        paved: all of that together.
        open_roads: roads without houses.
        relief: heights of carriageway, pavement and terrain.
        plan: the land in triangles.
        ground: the same with heights; its first faces are the plan's, of which those of terrain carry any material.
        kerb_stones, markings: meshes upon it; tram tracks are part of the markings.
        edge: stations along the kerbs.
        bridges: railings, piers and markings of bridges, whose decks are part of `ground`.
        decks: outlines of the decks of bridges, empty without bridges.
    """

    streets: Streets
    town: np.ndarray
    bounds: np.ndarray
    height: Sheet
    outlines: Outlines
    paved: Geometry
    open_roads: Geometry
    relief: TerrainRelief
    plan: SurfacePlan
    ground: Mesh
    kerb_stones: Mesh
    markings: Mesh
    edge: Kerbside
    bridges: Mesh
    decks: Geometry

    def surfaced(self, terrain_materials: np.ndarray) -> Mesh:
        """The ground with terrain of given materials, (t,) rows in the plan's order."""
        materials = self.ground.materials.copy()
        materials[: len(self.plan.zone)][self.plan.zone == TERRAIN] = terrain_materials
        return Mesh(self.ground.vertices, self.ground.faces, materials)


@cached
def lay_groundwork(streets: Streets) -> Groundwork:
    """Lay the groundwork of a town, or take what an earlier process laid.

    Raises:
        ValueError: the network has no lanes.
    """
    if not streets.lanes:
        raise ValueError(f"town {streets.name!r} has no lanes: nothing to build a world around")
    places = np.concatenate([lane.centre[:, :2] for lane in streets.lanes])
    low, high = places.min(0), places.max(0)
    bounds = np.stack([low - _MARGIN_M, high + _MARGIN_M])
    streets, decks = split_levels(streets)
    outlines = outline(streets)
    plan = triangulate(outlines, *bounds)
    smooth = fit_height_field(streets, *bounds)(plan.points)
    height = Sheet(plan.triangles, smooth + unevenness(plan, streets.name))
    relief = TerrainRelief(height, outlines.crossings)
    land = ground_mesh(plan, relief, np.full(int((plan.zone == TERRAIN).sum()), CARRIAGEWAY, np.uint8))
    surfaces, bridges = decks_mesh(decks, height, outlines.carriageway)
    above = shapely.union_all([deck.outline for deck in decks])
    paint = [markings_mesh(deck.streets, deck.outline, deck.height) for deck in decks]
    paint += [tracks_mesh(deck.streets, deck.height) for deck in decks]
    return Groundwork(
        streets=streets,
        town=np.stack([low, high]),
        bounds=bounds,
        height=height,
        outlines=outlines,
        paved=shapely.union_all([outlines.paved, above]) if decks else outlines.paved,
        open_roads=open_roads(streets),
        relief=relief,
        plan=plan,
        ground=Mesh.merge([land, surfaces]) if decks else land,
        kerb_stones=kerb_stones(plan, relief),
        markings=Mesh.merge([markings_mesh(streets, outlines.carriageway, height), tracks_mesh(streets, height)]),
        edge=kerbside(streets, outlines),
        bridges=Mesh.merge([bridges, *paint]),
        decks=above,
    )
