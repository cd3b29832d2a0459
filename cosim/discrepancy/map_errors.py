"""Whether a map that is not exact explains more than any effect: spots of it that stand off, each by its own error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cosim.discrepancy.data.frames import Scatter, TracedFrame
from cosim.discrepancy.data.sample import same_beams
from cosim.discrepancy.inference.fit import Fitted, Fitter
from cosim.discrepancy.ranking import gain
from cosim.discrepancy.twin_scatter import map_scatter_m, with_scatter


def unsure_map(
    frames: Sequence[TracedFrame], fitter: Fitter, fitted: Fitted, quick: Fitter, null: Fitted, other: float
) -> Scatter | None:
    """How far the twin is off with its map, if that explains more than anything else; None if not.

    One number, how far spots of the map scatter, takes the place of an effect: where an effect is missing its own law
    explains more than that ranges are unsure.

    Args:
        frames: whose map is taken for exact.
        fitter, fitted: the model as it stands.
        quick, null: the same with fewer beams.
        other: fall of the BIC by the best of other explanations.
    """
    known = frames[0].scatter
    off_m = map_scatter_m(frames, fitter, fitted)
    if off_m <= 0:
        return None
    scatter = replace(known, map_m=off_m)
    unsure = Fitter(same_beams(quick.sample, with_scatter(frames, scatter)))
    found = unsure.fit(null.effects, (), pose=null.pose, pose_sigma=null.pose_sigma)
    delta_bic = 2 * gain(quick, null, found) - np.log(float(len(quick.sample)))
    return scatter if delta_bic > other else None
