"""The recipes of the built-in towns."""

from __future__ import annotations

from sumo_nets.recipe import (
    Demand,
    GridLayout,
    KindShares,
    RandomLayout,
    Recipe,
    Relief,
    RingRoadLayout,
    SpiderLayout,
    StreetRules,
)

_SMALL_TOWN = Recipe(
    name="town01",
    style="village",
    seed=11,
    layout=GridLayout(columns=6, rows=6, spacing_m=112, jitter_m=9),
    relief=Relief(range_m=5),
    streets=StreetRules(dropped=0.17, bend_m=7, signal_share=0.9, parking_share=0.9, main_parking_share=0.35),
    demand=Demand(driving=100, parked=640, walking=45),
)

_VILLAGE_WITH_ROUNDABOUTS = Recipe(
    name="town02",
    style="hamlet",
    seed=23,
    layout=GridLayout(columns=5, rows=4, spacing_m=130, jitter_m=14),
    relief=Relief(range_m=4),
    streets=StreetRules(
        dropped=0.13,
        bend_m=15,
        main_lanes=1,
        main_routes=2,
        widened=6,
        signal_share=0,
        roundabouts=3,
        parking_share=0.8,
        main_parking_share=0.3,
    ),
    demand=Demand(driving=80, parked=350, walking=30, kinds=KindShares(van=0.1, cyclist=0.08, bus=0.005)),
)

_SUBURB = Recipe(
    name="town03",
    style="suburb",
    seed=3,
    layout=RandomLayout(iterations=46, spacing_m=(75.0, 130.0)),
    relief=Relief(range_m=5),
    streets=StreetRules(
        dropped=0.05,
        bend_m=14,
        main_lanes=1,
        main_routes=2,
        widened=6,
        parking_share=0.9,
        main_parking_share=0.35,
        slanted_share=0.2,
        signal_share=0.3,
    ),
    demand=Demand(driving=85, parked=375, walking=40),
)

_RESIDENTIAL_GRID = Recipe(
    name="town04",
    style="suburb",
    seed=4,
    layout=GridLayout(columns=7, rows=6, spacing_m=88, jitter_m=0),
    relief=Relief(range_m=2),
    streets=StreetRules(
        dropped=0.06,
        bend_m=0,
        main_lanes=1,
        main_routes=2,
        widened=6,
        parking_share=1.0,
        main_parking_share=0.35,
        slanted_share=0.12,
        stop_share=0.8,
    ),
    demand=Demand(driving=95, parked=660, walking=60, kinds=KindShares(cyclist=0.10)),
)

_URBAN_CORE = Recipe(
    name="town05",
    style="urban",
    seed=5,
    layout=GridLayout(columns=6, rows=6, spacing_m=100, jitter_m=5),
    relief=Relief(range_m=2),
    streets=StreetRules(
        dropped=0.06,
        bend_m=3,
        main_lanes=3,
        main_routes=4,
        signal_share=1,
        sidewalk_width_m=3.6,
        parking_share=0.9,
        main_parking_share=0.35,
    ),
    demand=Demand(driving=150, parked=455, walking=110, kinds=KindShares(van=0.12, bus=0.03, cyclist=0.07)),
)

_RING_ROAD = Recipe(
    name="town06",
    style="suburb",
    seed=6,
    layout=RingRoadLayout(),
    relief=Relief(range_m=4),
    streets=StreetRules(dropped=0.06, bend_m=0, main_lanes=2, main_speed_kmh=60, parking_share=0.95, signal_share=0),
    demand=Demand(driving=130, parked=115, walking=35, kinds=KindShares(truck=0.05)),
)

_HILLS = Recipe(
    name="town07",
    style="hamlet",
    seed=7,
    layout=SpiderLayout(arms=6, circles=4, spacing_m=78),
    relief=Relief(range_m=40, waves=3, wavelength_m=(500.0, 900.0), max_grade=0.079),
    streets=StreetRules(
        dropped=0.15, bend_m=14, main_lanes=1, main_routes=2, widened=6, parking_share=0.85, signal_share=0.2
    ),
    demand=Demand(driving=85, parked=450, walking=35),
)

_INDUSTRY = Recipe(
    name="town08",
    style="industrial",
    seed=8,
    layout=GridLayout(columns=4, rows=5, spacing_m=165, jitter_m=7),
    relief=Relief(range_m=3),
    streets=StreetRules(
        dropped=0.1,
        bend_m=5,
        lane_width_m=3.5,
        main_lanes=2,
        main_routes=3,
        main_speed_kmh=60,
        local_speed_kmh=50,
        parking_share=0.8,
        parking_width_m=2.6,
        slanted_share=0.2,
    ),
    demand=Demand(driving=100, parked=305, walking=20, kinds=KindShares(car=0.55, van=0.18, truck=0.20, cyclist=0.03)),
)

_BOULEVARDS = Recipe(
    name="town09",
    style="boulevard",
    seed=9,
    layout=GridLayout(columns=5, rows=4, spacing_m=150, jitter_m=8),
    relief=Relief(range_m=6),
    streets=StreetRules(
        dropped=0.1,
        bend_m=5,
        main_lanes=2,
        main_routes=3,
        median_m=8,
        parking_share=0.85,
        main_parking_share=0.8,
        signal_share=0.8,
        sidewalk_width_m=4.2,
    ),
    tram_line=("B2", "C2", "D2", "D3", "C3", "B3"),
    demand=Demand(driving=120, parked=595, walking=90, trams=6, kinds=KindShares(bus=0.02, cyclist=0.08)),
)

RECIPES: dict[str, Recipe] = {
    recipe.name: recipe
    for recipe in (
        _SMALL_TOWN,
        _VILLAGE_WITH_ROUNDABOUTS,
        _SUBURB,
        _RESIDENTIAL_GRID,
        _URBAN_CORE,
        _RING_ROAD,
        _HILLS,
        _INDUSTRY,
        _BOULEVARDS,
    )
}

TOWNS: tuple[str, ...] = tuple(RECIPES)
