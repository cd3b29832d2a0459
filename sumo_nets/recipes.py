"""The recipes of the built-in towns."""

from __future__ import annotations

from sumo_nets.recipe import Demand, GridLayout, Recipe, Relief, StreetRules

RECIPES: dict[str, Recipe] = {
    recipe.name: recipe
    for recipe in (
        Recipe(
            name="town01",
            style="village",
            seed=11,
            layout=GridLayout(columns=6, rows=6, spacing_m=112, jitter_m=9),
            relief=Relief(range_m=5),
            streets=StreetRules(dropped=0.17, bend_m=7, signal_share=0.9),
            demand=Demand(driving=100, parked=200, walking=45),
        ),
    )
}

TOWNS: tuple[str, ...] = tuple(RECIPES)
