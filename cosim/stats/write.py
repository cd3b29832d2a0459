"""The page on disk, and the result of the command as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from cosim.drives.writer import explained
from cosim.stats.compare import Distance, points_ratio
from cosim.stats.page import format_page
from cosim.stats.summary import DISTANCE_EDGES_M, summarise
from cosim.stats.tally import Collected
from cosim.stats.two_sample import TwoSample


def write_stats(
    folder: Path,
    sets: Sequence[Collected],
    distances: Sequence[Distance],
    beside: Sequence[Distance] = (),
    separation: TwoSample | str | None = None,
) -> Path:
    """Write `folder/index.html` about one set, or two with their distances, or three; returns its path.

    Args:
        folder: where.
        sets: the set, the reference, and a third one that is also compared with the reference.
        distances: of the first from the second.
        beside: distances of the third set from the second.
        separation: the two-sample test of the first two, or why there is none.

    Raises:
        OutputError: the folder cannot be written.
    """
    index = folder / "index.html"
    with explained(folder):
        folder.mkdir(parents=True, exist_ok=True)
        index.write_text(format_page(sets, distances, beside, separation), encoding="utf-8", newline="\n")
    return index


def as_json(
    sets: Sequence[Collected],
    distances: Sequence[Distance],
    beside: Sequence[Distance] = (),
    separation: TwoSample | str | None = None,
) -> dict[str, Any]:
    """`{"set": …, "against": … or null, "distances": {KEY: …} or null, "points_ratio": […] or null}`; NaN is null.

    With a third set also `"beside": {"set": …, "distances": {KEY: …}}`. `"two_sample"` is the test of the first two
    sets, null where there is none.
    """
    result: dict[str, Any] = {"set": summarise(sets[0]), "against": None, "distances": None, "points_ratio": None}
    if len(sets) > 1:
        result["against"] = summarise(sets[1])
        result["distances"] = {distance.key: distance.as_json() for distance in distances}
        if all(found.scanned.any() for found in sets):
            ratios = points_ratio(sets[0], sets[1], DISTANCE_EDGES_M)
            result["points_ratio"] = [
                {"from_m": float(low), "to_m": float(high), "median_ratio": float(ratio)}
                for (low, high), ratio in zip(pairwise(DISTANCE_EDGES_M), ratios, strict=True)
            ]
    if len(sets) > 2:
        distances_beside = {distance.key: distance.as_json() for distance in beside}
        result["beside"] = {"set": summarise(sets[2]), "distances": distances_beside}
    result["two_sample"] = separation.as_json() if isinstance(separation, TwoSample) else None
    return _without_nan(result)


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
