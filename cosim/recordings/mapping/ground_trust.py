"""Which beams may be compared with a map: `twin/trust/NAME.npz`, the ground's cells about each scan."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from cosim.discrepancy.labelled_twin.trust import CELL_M, Trust
from cosim.recordings.mapping.build import SurfelMap

_REACH_M = 35.0
_NEAREST_M = 0.35  # of a surfel to the middle of a cell that it stands for


class GroundTrust:
    """Trusted ground of every scan of a map.

    Args:
        made: the map.
    """

    def __init__(self, made: SurfelMap) -> None:
        self._surfels = made.surfels[made.ground]
        self._tree = KDTree(self._surfels.centre[:, :2]) if len(self._surfels) else None

    def of(self, place_m: np.ndarray) -> Trust:
        """The trusted cells about a place (3,) in world axes."""
        if self._tree is None:
            return Trust.nothing()
        count = round(2 * _REACH_M / CELL_M)
        corner = np.floor(place_m[:2] / CELL_M) * CELL_M - _REACH_M
        middle = corner[0] + (np.arange(count) + 0.5) * CELL_M, corner[1] + (np.arange(count) + 0.5) * CELL_M
        xy = np.stack(np.meshgrid(*middle, indexing="ij"), -1).reshape(-1, 2)
        away, row = self._tree.query(xy, distance_upper_bound=_NEAREST_M)
        known = np.isfinite(away)
        row = np.where(known, row, 0)
        centre, normal = self._surfels.centre[row], self._surfels.normal[row]
        fall = ((xy - centre[:, :2]) * normal[:, :2]).sum(1) / normal[:, 2]
        shape = (count, count)
        return Trust(
            corner_m=corner,
            cell_m=CELL_M,
            ground=known.reshape(shape),
            height_m=np.where(known, centre[:, 2] - fall, 0).reshape(shape).astype(np.float32),
            ground_range=True,
            cone_deg=0.0,
            lever_m=0.0,
            height_sd_m=np.where(known, self._surfels.sd_m[row], 0).reshape(shape).astype(np.float32),
        )
