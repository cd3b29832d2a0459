"""Styles of towns: ranges from which plots, houses and vegetation are drawn, one row per style."""

from __future__ import annotations

from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class TownStyle:
    """Ranges of one kind of town.

    Attributes:
        setback_m: from the edge of the pavement to the façade.
        front_m, depth_m: building size along and away from the street.
        side_gap_m: between neighbours; zero makes a terrace.
        storeys: lowest and highest count of storeys.
        storey_m: storey height.
        roofs: roof kinds to choose from (repeat one to make it more likely).
        walls: façade materials to choose from.
        bay_m: distance of window axes.
        shop_share: share of buildings with shop windows at street level.
        fence_share: share of plots with a fence, wall or hedge in front.
        street_tree_gap_m: distance of trees along the pavement; 0 for none.
        garden_trees: trees in a plot, mean count.
        lamp_gap_m: distance of street lamps.
        ground: terrain materials: the usual one, then the one of patches.
        gap_share: share of the frontage left open.
        fences: border kinds to choose from.
        conifer_share: share of conifers among garden trees.
        meadow_chance: chance that open land follows a house.
        enclosed: share of the open frontage behind a hedge, wall or hedgerow.
        enclosures: border kinds of these.
        wild_trees: trees on open land over the usual number.
        garden_shrubs: shrubs in a plot, mean count.
        bed_gap_m: distance of shrub beds behind the pavement, or next to a street without one; 0 for none.
        climbers: share of houses with climbing plants on their walls.
        verge_share: share of pavements with a strip of grass along the kerb.
    """

    setback_m: Range
    front_m: Range
    depth_m: Range
    side_gap_m: Range
    storeys: tuple[int, int]
    storey_m: Range
    roofs: tuple[str, ...]
    walls: tuple[str, ...]
    bay_m: Range
    shop_share: float
    fence_share: float
    street_tree_gap_m: float
    garden_trees: float
    lamp_gap_m: float
    ground: tuple[str, str]
    gap_share: float
    fences: tuple[str, ...]
    conifer_share: float
    meadow_chance: float
    enclosed: float
    enclosures: tuple[str, ...]
    wild_trees: float = 1.0
    garden_shrubs: float = 1.0
    bed_gap_m: float = 40.0
    climbers: float = 0.15
    verge_share: float = 0.3

    @property
    def terrace(self) -> bool:
        """Whether neighbouring houses share walls."""
        return self.side_gap_m[1] < 0.5


_RENDERED = ("plaster_white", "plaster_white", "plaster_yellow", "plaster_grey", "plaster_red", "brick")

STYLES: dict[str, TownStyle] = {
    "village": TownStyle(
        setback_m=(15.0, 32.0),
        front_m=(6.0, 9.0),
        depth_m=(6.5, 9.0),
        side_gap_m=(12.0, 30.0),
        storeys=(1, 1),
        storey_m=(2.6, 2.9),
        roofs=("gable", "gable", "gable", "hip"),
        walls=(*_RENDERED, "stone"),
        bay_m=(2.4, 3.4),
        shop_share=0.05,
        fence_share=0.85,
        street_tree_gap_m=18.0,
        garden_trees=0.5,
        lamp_gap_m=50.0,
        ground=("grass", "soil"),
        gap_share=0.35,
        fences=("picket", "wall_stone", "hedge", "hedge", "hedge", "hedge"),
        conifer_share=0.2,
        meadow_chance=0.8,
        enclosed=0.9,
        enclosures=("hedge", "hedge", "hedge", "hedge", "wall_brick", "wall_plaster"),
        wild_trees=0.4,
        garden_shrubs=4.0,
        bed_gap_m=14.0,
        climbers=0.3,
        verge_share=0.5,
    ),
    "hamlet": TownStyle(
        setback_m=(0.8, 6.0),
        front_m=(8.0, 13.5),
        depth_m=(8.0, 11.0),
        side_gap_m=(1.5, 9.0),
        storeys=(1, 3),
        storey_m=(2.5, 2.8),
        roofs=("gable", "gable", "gable", "hip"),
        walls=("stone", "stone", "plaster_white", "plaster_yellow", "brick"),
        bay_m=(2.3, 3.2),
        shop_share=0.08,
        fence_share=0.8,
        street_tree_gap_m=18.0,
        garden_trees=0.9,
        lamp_gap_m=40.0,
        ground=("grass", "soil"),
        gap_share=0.12,
        fences=("wall_stone", "picket", "hedge", "hedge", "hedge"),
        conifer_share=0.3,
        meadow_chance=0.16,
        enclosed=0.9,
        enclosures=("hedge", "hedge", "hedge", "hedge", "hedge", "wall_plaster"),
        wild_trees=1.4,
        garden_shrubs=4.0,
        bed_gap_m=14.0,
        climbers=0.35,
        verge_share=0.6,
    ),
    "suburb": TownStyle(
        setback_m=(3.0, 6.5),
        front_m=(8.5, 15.0),
        depth_m=(8.0, 11.5),
        side_gap_m=(2.5, 6.0),
        storeys=(1, 2),
        storey_m=(2.6, 2.9),
        roofs=("gable", "gable", "hip", "flat"),
        walls=_RENDERED,
        bay_m=(2.4, 3.2),
        shop_share=0.03,
        fence_share=0.9,
        street_tree_gap_m=16.0,
        garden_trees=1.1,
        lamp_gap_m=34.0,
        ground=("grass", "soil"),
        gap_share=0.1,
        fences=("picket", "hedge", "hedge", "hedge", "hedge", "wall_brick", "wall_plaster"),
        conifer_share=0.25,
        meadow_chance=0.2,
        enclosed=0.9,
        enclosures=("hedge", "hedge", "hedge", "hedge", "wall_brick", "wall_plaster"),
        garden_shrubs=5.0,
        bed_gap_m=14.0,
        climbers=0.25,
        verge_share=0.5,
    ),
    "urban": TownStyle(
        setback_m=(0.25, 0.6),
        front_m=(11.0, 22.0),
        depth_m=(10.0, 13.0),
        side_gap_m=(0.04, 0.08),
        storeys=(2, 4),
        storey_m=(2.9, 3.4),
        roofs=("gable", "gable", "flat"),
        walls=(*_RENDERED, "stone", "brick"),
        bay_m=(2.9, 3.9),
        shop_share=0.45,
        fence_share=0.5,
        street_tree_gap_m=24.0,
        garden_trees=0.5,
        lamp_gap_m=26.0,
        ground=("paving", "gravel"),
        gap_share=0.1,
        fences=("wall_brick", "wall_plaster", "railing"),
        conifer_share=0.05,
        meadow_chance=0.02,
        enclosed=0.55,
        enclosures=("hedge", "wall_brick", "wall_plaster"),
        wild_trees=0.6,
        garden_shrubs=1.2,
        bed_gap_m=30.0,
        climbers=0.2,
        verge_share=0.15,
    ),
    "industrial": TownStyle(
        setback_m=(5.0, 12.0),
        front_m=(18.0, 45.0),
        depth_m=(16.0, 32.0),
        side_gap_m=(5.0, 14.0),
        storeys=(1, 3),
        storey_m=(3.6, 4.5),
        roofs=("flat", "flat", "flat", "gable"),
        walls=("cladding_metal", "cladding_metal", "concrete", "brick"),
        bay_m=(4.0, 6.0),
        shop_share=0.0,
        fence_share=0.8,
        street_tree_gap_m=22.0,
        garden_trees=0.6,
        lamp_gap_m=38.0,
        ground=("gravel", "grass"),
        gap_share=0.15,
        fences=("railing", "wire", "wire", "wall_brick"),
        conifer_share=0.1,
        meadow_chance=0.06,
        enclosed=0.7,
        enclosures=("hedge", "hedge", "wall_brick", "wire"),
        garden_shrubs=2.5,
        bed_gap_m=18.0,
        climbers=0.1,
        verge_share=0.4,
    ),
    "boulevard": TownStyle(
        setback_m=(0.4, 3.0),
        front_m=(14.0, 26.0),
        depth_m=(12.0, 15.0),
        side_gap_m=(0.05, 0.1),
        storeys=(3, 5),
        storey_m=(3.1, 3.6),
        roofs=("flat", "gable"),
        walls=("plaster_white", "plaster_yellow", "stone", "stone", "concrete"),
        bay_m=(2.9, 3.8),
        shop_share=0.6,
        fence_share=0.3,
        street_tree_gap_m=18.0,
        garden_trees=0.25,
        lamp_gap_m=24.0,
        ground=("grass", "paving"),
        gap_share=0.08,
        fences=("railing", "hedge", "wall_stone"),
        conifer_share=0.0,
        meadow_chance=0.02,
        enclosed=0.65,
        enclosures=("hedge", "hedge", "wall_plaster"),
        wild_trees=0.2,
        garden_shrubs=1.2,
        bed_gap_m=20.0,
        climbers=0.1,
        verge_share=0.4,
    ),
}


def style_of(name: str) -> TownStyle:
    """The ranges of a style.

    Raises:
        ValueError: no such style.
    """
    if name not in STYLES:
        raise ValueError(f"street style {name!r} is unknown; use one of {', '.join(STYLES)}")
    return STYLES[name]
