"""A drive that is recorded in seconds: four streets, a few cars and a scanner of 16 lasers.

Whatever is about recording and files rather than about what is seen is tested on it.
"""

from __future__ import annotations

from pathlib import Path

import yaml

from sumo_nets import Demand, Recipe, build_town
from sumo_nets.recipe import GridLayout, Relief, StreetRules

RECIPE = Recipe(
    name="hamlet",
    style="suburb",
    seed=5,
    layout=GridLayout(columns=3, rows=2, spacing_m=80, jitter_m=5),
    relief=Relief(range_m=2),
    streets=StreetRules(dropped=0.0, bend_m=3, parking_share=0.5, signal_share=0.0),
    demand=Demand(driving=10, parked=12, walking=4),
)
RINGS, FIRINGS, FRAMES = 16, 500, 8


def write_hamlet(folder: Path) -> Path:
    """The town, its scanner and a configuration of two episodes of four frames; returns the configuration."""
    town = build_town(RECIPE, folder / "town")
    pattern = {
        "name": "small",
        "sweep_s": 0.1,
        "firings": FIRINGS,
        "range_m": [0.9, 120.0],
        "elevation_deg": [2.0 - 1.8 * ring for ring in range(RINGS)],
    }
    (folder / "small.yaml").write_text(yaml.safe_dump(pattern))
    (folder / "sensor.yaml").write_text("pattern: small.yaml\neffects: []\n")
    config = {
        "town": str(town),
        "sensor": str(folder / "sensor.yaml"),
        "seed": 3,
        "frames": FRAMES,
        "frames_per_episode": FRAMES // 2,
        "collection": {"every_s": 1.0},
        "warm_up_s": 5,
        "images": ["image_0", "image_2", "depth_0"],  # variants take intensities from the camera
    }
    path = folder / "run.yaml"
    path.write_text(yaml.safe_dump(config))
    return path
