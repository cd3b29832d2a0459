"""Plants trees along streets, in gardens, in hedgerows and on open land, and climbers on the walls of houses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assets.mesh import Mesh
from assets.world import polylines
from assets.world.buildings.houses import House
from assets.world.buildings.plots import BuildingPlot
from assets.world.ground.overlays import Heights, ribbons
from assets.world.instancing import instances, poses
from assets.world.obstacles import Obstacles
from assets.world.plants.trees import broadleaf, bush, climber, conifer, shrub
from assets.world.roads.kerbside import Kerbside
from assets.world.styles import TownStyle

_VARIANTS = 6
_TREE_TAKES_M = 1.8
_VERGE_M = 2.2  # from the kerb to street trees where there is no pavement
_BED_SHRUBS = (3, 8)
_BED_APART_M = (1.4, 2.8)
_BED_DEPTH_M = (1.0, 2.6)  # behind the pavement
_BED_VERGE_M = 0.8  # from the kerb, where there is no pavement
_BED_SIGHT_M = 8.0  # around crossroads nothing grows, for drivers' sight
_TALL_SHARE = 0.6
_KERB_STONE_M = 0.2  # from the carriageway to a verge
_VERGE_PAVEMENT_M, _VERGE_PATH_M = 2.2, 1.4  # narrowest pavement with a verge; what is left to walk on
_VERGE_WIDTH_M = (0.6, 1.8)
_VERGE_RISE_M = 0.02
_VERGE_STRETCH_M = 25.0  # mean length of stretches that are green or paved
_VERGE_JUNCTION_M, _VERGE_STEP_M = 5.0, 1.6
_ENTRANCE_STEPS, _ENTRANCE_GAP_M = 3, 12.0  # length of an entrance; mean distance
_OPEN_LAND_PER_M2 = 4e-4
_OPEN_LAND_MOST = 220
_WOODS_ROWS_M = (2.5, 8.0, 14.0)  # distances from the border of the land
_WOODS_GAP_M = 6.5
_CLIMBER_VARIANTS = 4
_CLIMBER_PATCH_M = ((1.5, 5.0), (1.8, 5.0))  # width and height
_CLIMBER_SIDES = 3  # the front and the two side walls; terraced houses have only the front


def trees_mesh(
    edge: Kerbside, plots: list[BuildingPlot], bounds: np.ndarray, blocked: Obstacles, stand_z: Heights,
    style: TownStyle,
    rng: np.random.Generator,
) -> Mesh:  # fmt: skip
    """Verges, street trees, garden plants, beds along the streets, thickets on open land, and woods around it."""
    return Mesh.merge(
        [
            _verges(edge, stand_z, style, rng),
            _street_trees(edge, blocked, stand_z, style, rng),
            _garden_plants(plots, blocked, stand_z, style, rng),
            _beds(edge, blocked, stand_z, style, rng),
            _open_land(bounds, blocked, stand_z, style, rng),
            _woods(bounds, blocked, stand_z, rng),
        ]
    )


def hedgerow_trees(
    spots: np.ndarray, blocked: Obstacles, stand_z: Heights, style: TownStyle, rng: np.random.Generator
) -> Mesh:
    """Trees at those of `spots` (n, 2) that are free."""
    return _scatter(_mixed(rng, style.conifer_share, 48), _rooted(spots, 2.5, 1.8, 2.0, blocked), stand_z, rng)


def _street_trees(
    edge: Kerbside, blocked: Obstacles, stand_z: Heights, style: TownStyle, rng: np.random.Generator
) -> Mesh:
    """Slender trees with high crowns near the kerb."""
    if style.street_tree_gap_m == 0.0:
        return Mesh.empty()
    rows = edge.every(style.street_tree_gap_m, rng)
    rows = rows[edge.junction_m[rows] > 6.0]
    behind_m = np.where(edge.pavement_m[rows] > 0.5, 0.45, _VERGE_M)
    spots = edge.point[rows] + behind_m[:, None] * edge.outward[rows]
    keep = blocked.free(spots, 1.1, road_m=0.25)
    keep[keep] = blocked.take(spots[keep], 1.5)
    radius = 1.3 if style.setback_m[0] < 1.0 else 1.8
    templates = []
    for _ in range(_VARIANTS):
        crown = (radius * rng.uniform(0.85, 1.15), radius * rng.uniform(0.85, 1.15))
        templates.append(broadleaf(rng, rng.uniform(8.5, 11.0), crown, rng.uniform(4.3, 4.9), clusters=72))
    return _scatter(templates, spots[keep], stand_z, rng)


def planted_trees(
    spots: Sequence[tuple[float, float]],
    blocked: Obstacles,
    stand_z: Heights,
    style: TownStyle,
    rng: np.random.Generator,
) -> Mesh:
    """Trees exactly where a town's files have them, except below bridges; others keep away."""
    places = np.array(spots, np.float64).reshape(-1, 2)
    places = places[~blocked.lies_below_deck(places)]
    blocked.take(places, _TREE_TAKES_M)
    return _scatter(_mixed(rng, style.conifer_share, 84), places, stand_z, rng)


def _garden_plants(
    plots: list[BuildingPlot], blocked: Obstacles, stand_z: Heights, style: TownStyle, rng: np.random.Generator
) -> Mesh:
    """Trees next to and behind the houses, bushes in front of them."""
    trees, bushes = [], []
    for plot in plots:
        deep = plot.setback_m + plot.size_m[1]
        for _ in range(rng.poisson(style.garden_trees)):
            across, inland = rng.uniform(-0.5, 0.5) * plot.width_m, rng.uniform(1.5, deep + 14.0)
            trees.append(plot.front + plot.along * across + plot.inward * inland)
        for _ in range(rng.poisson(style.garden_shrubs)):
            across, inland = rng.uniform(-0.5, 0.5) * plot.width_m, rng.uniform(0.9, plot.setback_m + 0.9)
            bushes.append(plot.front + plot.along * across + plot.inward * inland)
    tree, bushes = np.reshape(trees, (-1, 2)), np.reshape(bushes, (-1, 2))
    templates = _mixed(rng, style.conifer_share, 84)
    return Mesh.merge(
        [
            _scatter(templates, _rooted(tree, 1.8, 4.2, 1.8, blocked), stand_z, rng),
            _scatter(_low(rng), _rooted(bushes, 0.7, 1.3, 0.6, blocked), stand_z, rng),
        ]
    )


def _verges(edge: Kerbside, stand_z: Heights, style: TownStyle, rng: np.random.Generator) -> Mesh:
    """Strips of grass between kerb and pavement, with gaps where gardens and crossings are entered."""
    has_room = (edge.pavement_m >= _VERGE_PAVEMENT_M) & (edge.junction_m > _VERGE_JUNCTION_M)
    step_m = np.linalg.norm(np.diff(edge.point, axis=0), axis=1)
    joined = has_room[:-1] & has_room[1:] & (np.diff(edge.run) == 0) & (step_m < _VERGE_STEP_M)
    # Stretches of random length are green or paved; an entrance interrupts a green one.
    stretch = np.cumsum(rng.random(len(joined)) < 1 / _VERGE_STRETCH_M)
    is_green = rng.random(stretch.max(initial=0) + 1) < style.verge_share
    starts = rng.random(len(joined)) < 1 / _ENTRANCE_GAP_M
    is_entrance = np.convolve(starts, np.ones(_ENTRANCE_STEPS))[: len(joined)] > 0
    rows = np.flatnonzero(joined & is_green[stretch] & ~is_entrance)
    width_m = np.clip(edge.pavement_m - _VERGE_PATH_M, *_VERGE_WIDTH_M)
    middle = edge.spots(_KERB_STONE_M + width_m / 2)
    return ribbons(middle[rows], middle[rows + 1], width_m[rows], lambda xy: stand_z(xy) + _VERGE_RISE_M, "grass")


def _beds(edge: Kerbside, blocked: Obstacles, stand_z: Heights, style: TownStyle, rng: np.random.Generator) -> Mesh:
    """Shrubs in rows behind the pavement, or next to a street without one."""
    if style.bed_gap_m == 0.0:
        return Mesh.empty()
    spots, seen = [], edge.junction_m > _BED_SIGHT_M
    for row in edge.every(style.bed_gap_m, rng):
        count, apart, depth = int(rng.integers(*_BED_SHRUBS)), rng.uniform(*_BED_APART_M), rng.uniform(*_BED_DEPTH_M)
        rows = row + np.round(np.arange(count) * apart).astype(int)
        rows = rows[rows < len(edge.run)]
        rows = rows[(edge.run[rows] == edge.run[row]) & seen[rows]]
        behind_m = np.maximum(edge.pavement_m[rows], _BED_VERGE_M) + depth + rng.normal(0, 0.3, len(rows))
        spots.append(edge.point[rows] + behind_m[:, None] * edge.outward[rows])
    places = np.concatenate([np.zeros((0, 2)), *spots])
    tall = rng.random(len(places)) < _TALL_SHARE
    return Mesh.merge(
        [
            _scatter(_tall(rng), _rooted(places[tall], 1.2, 2.4, 1.0, blocked), stand_z, rng),
            _scatter(_low(rng), _rooted(places[~tall], 0.7, 1.3, 0.5, blocked), stand_z, rng),
        ]
    )


def _low(rng: np.random.Generator) -> list[Mesh]:
    return [bush(rng, rng.uniform(0.8, 1.8), rng.uniform(0.5, 1.0)) for _ in range(_VARIANTS)]


def _tall(rng: np.random.Generator) -> list[Mesh]:
    return [shrub(rng, rng.uniform(2.0, 4.5), rng.uniform(1.0, 1.9)) for _ in range(_VARIANTS)]


def _open_land(
    bounds: np.ndarray, blocked: Obstacles, stand_z: Heights, style: TownStyle, rng: np.random.Generator
) -> Mesh:
    """Loose groups of trees with shrubs below them between and around the blocks."""
    area = float(np.prod(bounds[1] - bounds[0]))
    count = int(min(_OPEN_LAND_MOST, area * _OPEN_LAND_PER_M2) * style.wild_trees)
    groups = rng.uniform(bounds[0] + 4.0, bounds[1] - 4.0, (max(1, count // 3), 2))
    spots = np.repeat(groups, 3, axis=0) + rng.normal(0.0, 6.0, (len(groups) * 3, 2))
    spots = np.clip(spots, bounds[0] + 2.0, bounds[1] - 2.0)
    templates = _mixed(rng, max(style.conifer_share, 0.15), 48, fine=False)
    below = spots + rng.normal(0.0, 3.0, spots.shape)
    below = np.clip(below, bounds[0] + 2.0, bounds[1] - 2.0)
    return Mesh.merge(
        [
            _scatter(templates, _rooted(spots, 2.5, 4.2, 2.2, blocked), stand_z, rng),
            _scatter(_tall(rng), _rooted(below, 1.8, 3.0, 1.0, blocked), stand_z, rng),
        ]
    )


def _woods(bounds: np.ndarray, blocked: Obstacles, stand_z: Heights, rng: np.random.Generator) -> Mesh:
    """Rows of tall trees along the border of the land: the skyline of what lies beyond."""
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) * (bounds[1] - bounds[0])
    ring = bounds[0] + corners
    spots = []
    for inset in _WOODS_ROWS_M:
        station = np.arange(rng.uniform(0, _WOODS_GAP_M), polylines.stations(ring)[-1], _WOODS_GAP_M)
        spot = polylines.at(ring, station) + rng.normal(0.0, 1.5, (len(station), 2))
        spots.append(np.clip(spot, bounds[0] + inset, bounds[1] - inset))
    templates = [
        broadleaf(rng, height, (height * 0.3, height * 0.3), height * 0.1, 48, fine=False)
        for height in rng.uniform(12.0, 19.0, _VARIANTS)
    ]
    templates += [conifer(rng, height, height * 0.2) for height in rng.uniform(14.0, 22.0, _VARIANTS // 2)]
    return _scatter(templates, _rooted(np.concatenate(spots), 4.0, 6.0, 1.8, blocked), stand_z, rng)


def _mixed(rng: np.random.Generator, conifer_share: float, clusters: int, *, fine: bool = True) -> list[Mesh]:
    """Garden and field trees: round, oval and columnar crowns and some spruces."""
    templates = []
    for _ in range(2 * _VARIANTS):
        height = rng.uniform(4.5, 11.0)
        if rng.random() < conifer_share:
            templates.append(conifer(rng, height, height * rng.uniform(0.17, 0.24)))
            continue
        radius = min(height * rng.uniform(0.16, 0.30), 2.4)
        crown = (radius, radius * rng.uniform(0.85, 1.15))
        templates.append(broadleaf(rng, height, crown, height * rng.uniform(0.18, 0.3), clusters, fine=fine))
    return templates


def _rooted(spots: np.ndarray, house_m: float, road_m: float, spacing_m: float, blocked: Obstacles) -> np.ndarray:
    """The spots off all pavement and far enough from houses, the road and other plants; reserved."""
    spots = spots[blocked.free(spots, house_m, road_m, paved_m=0.55 * road_m)]
    return spots[blocked.take(spots, spacing_m)]


def _scatter(templates: list[Mesh], spots: np.ndarray, stand_z: Heights, rng: np.random.Generator) -> Mesh:
    """One random template, turned and scaled, at every spot."""
    choice = rng.integers(len(templates), size=len(spots))
    yaw, scale = rng.uniform(0, 2 * np.pi, len(spots)), rng.uniform(0.85, 1.15, len(spots))
    placed = poses(np.column_stack([spots, stand_z(spots) - 0.03]), yaw, scale)
    return Mesh.merge([instances(template, placed[choice == k]) for k, template in enumerate(templates)])


def climbers_mesh(houses: list[House], stand_z: Heights, share: float, rng: np.random.Generator) -> Mesh:
    """A patch of leaves on a wall of some houses; `stand_z` gives the height of the ground."""
    patches = [
        climber(rng, float(rng.uniform(*_CLIMBER_PATCH_M[0])), float(rng.uniform(*_CLIMBER_PATCH_M[1])))
        for _ in range(_CLIMBER_VARIANTS)
    ]
    widths = [float(patch.vertices[:, 0].max()) for patch in patches]
    placed: list[list[np.ndarray]] = [[] for _ in patches]
    for house in houses:
        drawn, which, wall, position = (
            rng.random(),
            int(rng.integers(_CLIMBER_VARIANTS)),
            int(rng.integers(_CLIMBER_SIDES)),
            rng.random(),
        )
        if drawn >= share:
            continue
        corners = house.plot.corners()
        side = 0 if house.terrace else (0, 1, 3)[wall]
        start, end = corners[side], corners[(side + 1) % 4]
        length = float(np.linalg.norm(end - start))
        free = length - widths[which]
        if free <= 0:
            continue
        along = (end - start) / length
        pose = np.eye(4)
        pose[:2, 0], pose[:2, 1] = -along, [along[1], -along[0]]  # y out of the wall
        pose[:2, 3] = start + along * (position * free + widths[which])
        pose[2, 3] = float(stand_z(pose[None, :2, 3])[0])
        tallest = house.eaves_m - pose[2, 3]
        pose[2, 2] = min(1.0, tallest / float(patches[which].vertices[:, 2].max()))
        placed[which].append(pose)
    return Mesh.merge(
        [instances(patch, np.stack(subset)) for patch, subset in zip(patches, placed, strict=True) if subset]
    )
