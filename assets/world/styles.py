"""What towns look like: ranges from which plots, houses and greenery are drawn, one row a style."""

from __future__ import annotations

from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class Style:
    """Ranges of one kind of town.

    Attributes:
        setback_m: from the edge of the pavement to the façade.
        front_m, depth_m: building size along and away from the street.
        side_gap_m: between neighbours; zero makes a terrace.
        storeys: lowest and highest count of storeys.
        storey_m: storey height.
        roofs: roof kinds to choose from (repeat one to make it likelier).
        walls: façade materials to choose from.
        bay_m: distance of window axes.
        shop_share: share of buildings with shop windows at street level.
        fence_share: share of plots with a fence, wall or hedge in front.
        street_tree_gap_m: distance of trees along the pavement; 0 for none.
        garden_trees: trees in a plot, mean count.
        lamp_gap_m: distance of street lamps.
        ground: terrain materials: the usual one, then the one of patches.
        gap_share: share of the frontage left open.
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


_RENDERED = ("plaster_white", "plaster_white", "plaster_yellow", "plaster_grey", "plaster_red", "brick")

STYLES: dict[str, Style] = {
    "village": Style(
        (1.5, 7.0), (8.0, 14.0), (8.0, 12.0), (3.0, 10.0), (1, 2), (2.6, 2.9),
        ("gable", "gable", "gable", "hip"), (*_RENDERED, "stone"), (2.4, 3.4),
        0.05, 0.75, 0.0, 1.6, 45.0, ("grass", "soil"), 0.22,
    ),
    "suburb": Style(
        (3.0, 6.5), (8.5, 15.0), (8.0, 11.5), (2.5, 6.0), (1, 2), (2.6, 2.9),
        ("gable", "gable", "hip", "flat"), _RENDERED, (2.4, 3.2),
        0.03, 0.85, 28.0, 1.3, 34.0, ("grass", "soil"), 0.10,
    ),
    "urban": Style(
        (0.25, 0.6), (10.0, 20.0), (10.0, 13.0), (0.04, 0.08), (3, 5), (2.9, 3.4),
        ("gable", "gable", "flat", "hip"), (*_RENDERED, "stone", "brick"), (2.2, 2.9),
        0.45, 0.5, 24.0, 0.5, 26.0, ("paving", "gravel"), 0.10,
    ),
    "industrial": Style(
        (5.0, 12.0), (18.0, 45.0), (16.0, 32.0), (5.0, 14.0), (1, 3), (3.6, 4.5),
        ("flat", "flat", "flat", "gable"), ("cladding_metal", "cladding_metal", "concrete", "brick"), (4.0, 6.0),
        0.0, 0.8, 40.0, 0.6, 38.0, ("gravel", "grass"), 0.15,
    ),
    "boulevard": Style(
        (0.4, 3.0), (14.0, 26.0), (12.0, 15.0), (0.05, 0.1), (4, 6), (3.1, 3.6),
        ("hip", "flat", "gable"), ("plaster_white", "plaster_yellow", "stone", "stone", "concrete"), (2.3, 2.9),
        0.6, 0.3, 14.0, 0.4, 24.0, ("grass", "paving"), 0.08,
    ),
}  # fmt: skip


def style_of(name: str) -> Style:
    """The ranges of a style.

    Raises:
        ValueError: no such style.
    """
    if name not in STYLES:
        raise ValueError(f"street style {name!r} is unknown; use one of {', '.join(STYLES)}")
    return STYLES[name]
