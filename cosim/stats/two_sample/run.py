"""From two sets of frames to the two-sample test between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cosim.drives.kitti import Frame
from cosim.errors import CosimError
from cosim.stats.frame_set import FrameSet
from cosim.stats.two_sample.grid import PatchGrid
from cosim.stats.two_sample.patches import collect_patches
from cosim.stats.two_sample.result import TwoSample
from cosim.stats.two_sample.separation import TwoSampleSettings, is_available, separate_sets

MOST_FRAMES = 120
_FEWEST_POINTS = 100


def separate(
    a: FrameSet,
    b: FrameSet,
    units: str = "frame",
    sector_deg: float = 90.0,
    *,
    settings: TwoSampleSettings | None = None,
    on_frame: Callable[[str], None] = lambda name: None,
) -> TwoSample | str:
    """Test whether the scans of `a` can be distinguished from those of the reference `b`.

    At most 120 frames of each set are used, evenly spread.

    Args:
        a, b: the sets.
        units: what is independent: `frame`, a number of frames in a row, or `drive`, a frame's name up to its last `_`.
        sector_deg: sector about the forward direction.
        settings: numeric choices of the test.
        on_frame: called with the name of every frame before it is read.

    Returns:
        The result, or a sentence that says why there is none.

    Raises:
        CosimError: `units` or `sector_deg` break their rules, or a file is broken.
    """
    if not 10 <= sector_deg <= 360:
        raise CosimError(f"the sector is {sector_deg:g}°; give 10 to 360")
    numbered = [_number_units(source, units) for source in (a, b)]
    settings = settings or TwoSampleSettings()
    for source, (frames, _) in zip((a, b), numbered, strict=True):
        if not frames:
            return f"{source.title} has no scan"
    if not is_available():
        return "scikit-learn is not installed: pip install 'cosim[stats]'"
    for source, (_, numbers) in zip((a, b), numbered, strict=True):
        if len(set(numbers)) < settings.fewest_units:
            return f"{source.title} has {len(set(numbers))} units of frames; {settings.fewest_units} are needed"
    if min(len(frames[0].points) for frames, _ in numbered) < _FEWEST_POINTS:
        return f"a scan has fewer than {_FEWEST_POINTS} points"
    grid = PatchGrid.common([frames for frames, _ in numbered], sector_deg)
    patches = [collect_patches(frames, grid, numbers, on_frame) for frames, numbers in numbered]
    for source, found in zip((a, b), patches, strict=True):
        if found.units < settings.fewest_units:
            return (
                f"{source.title} has {found.units} units with a patch that returns; {settings.fewest_units} are needed"
            )
    result = separate_sets(patches[0], patches[1], np.random.default_rng(0), settings)
    return replace(
        result,
        information={
            "titles": [a.title, b.title],
            "frames": [len(frames) for frames, _ in numbered],
            "unit": units,
            **result.information,
            "grid": {
                "rows": grid.rows,
                "columns": grid.columns,
                "step_deg": float(np.degrees(grid.step_rad)),
                "sector_deg": sector_deg,
                "patch": list(grid.patch),
                "rows_are_lasers": grid.elevation_edges_rad is None,
            },
        },
    )


def _number_units(source: FrameSet, units: str) -> tuple[Sequence[Frame], list[int]]:
    """Frames that are used, and the unit of each in order."""
    frames = [frame for frame in source if frame.has("velodyne")]
    if units == "frame":
        keys = [frame.name for frame in frames]
    elif units == "drive":
        keys = [frame.name.rpartition("_")[0] for frame in frames]
    elif units.isdecimal() and int(units) > 0:
        keys = [str(position // int(units)) for position in range(len(frames))]
    else:
        raise CosimError(f"units are {units!r}; give frame, drive or a number of frames above 0")
    chosen = np.unique(np.linspace(0, len(frames) - 1, min(len(frames), MOST_FRAMES)).astype(int)) if frames else []
    number = {key: position for position, key in enumerate(dict.fromkeys(keys[k] for k in chosen))}
    return [frames[k] for k in chosen], [number[keys[k]] for k in chosen]
