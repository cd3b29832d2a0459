"""Index of the rays that can hit a box: an angular grid over the directions of a sensor's rays."""

from __future__ import annotations

import numpy as np

from sensors.rays import Rays

_AZIMUTH_BINS = 720
_ELEVATION_BIN_RAD = np.radians(0.25)


class RayIndex:
    """Rays sorted into bins of elevation and azimuth, so that a box's window is a few contiguous runs.

    Works for any set of rays whose origins lie near the sensor's origin.
    """

    def __init__(self, rays: Rays) -> None:
        x, y, z = rays.direction.astype(np.float64).T
        elevation = np.arctan2(z, np.hypot(x, y))
        self._lowest = float(elevation.min()) if len(rays) else 0.0
        row = ((elevation - self._lowest) / _ELEVATION_BIN_RAD).astype(np.int64)
        column = np.floor((np.arctan2(y, x) + np.pi) / (2 * np.pi) * _AZIMUTH_BINS).astype(np.int64)
        cell = row * _AZIMUTH_BINS + np.clip(column, 0, _AZIMUTH_BINS - 1)
        self._rows = int(row.max()) + 1 if len(rays) else 0
        self._order = np.argsort(cell, kind="stable").astype(np.int32)
        counts = np.bincount(cell, minlength=self._rows * _AZIMUTH_BINS)
        self._starts = np.concatenate([[0], np.cumsum(counts)])
        self._spread_m = float(np.linalg.norm(rays.origin, axis=1).max()) if len(rays) else 0.0

    def window_pairs(self, corners: np.ndarray, nearest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of (ray, box) that may meet; no pair that meets is left out.

        Args:
            corners: (k, 8, 3) corners of the boxes in the sensor's axes [m].
            nearest: (k,) distance from the sensor's origin to each box [m], 0 inside.

        Returns:
            Ray rows (p,) int32 and box rows (p,) int32, sorted by box.
        """
        low_row, high_row, first, last = self._bins(corners, nearest)
        rows = np.maximum(high_row - low_row + 1, 0)
        box = np.repeat(np.arange(len(corners)), rows)
        row = np.arange(rows.sum()) - np.repeat(np.cumsum(rows) - rows, rows) + low_row[box]
        # A window that runs over ±π becomes two runs of a row.
        wraps = last[box] >= _AZIMUTH_BINS
        run_box = np.concatenate([box, box[wraps]])
        run_first = np.concatenate([row * _AZIMUTH_BINS + first[box], row[wraps] * _AZIMUTH_BINS])
        run_last = np.concatenate(
            [
                row * _AZIMUTH_BINS + np.minimum(last[box], _AZIMUTH_BINS - 1),
                row[wraps] * _AZIMUTH_BINS + last[box][wraps] - _AZIMUTH_BINS,
            ]
        )
        start, stop = self._starts[run_first], self._starts[run_last + 1]
        by_box = np.argsort(run_box, kind="stable")
        start, length, run_box = start[by_box], (stop - start)[by_box], run_box[by_box]
        inside = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
        return self._order[inside + np.repeat(start, length)], np.repeat(run_box, length).astype(np.int32)

    def _bins(self, corners: np.ndarray, nearest: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Elevation rows low…high and azimuth bins first…last (last may pass the end) of each box."""
        pad = self._spread_m + 1e-3
        x, y, z = np.moveaxis(corners, 2, 0)
        z_low, z_high = z.min(1) - pad, z.max(1) + pad
        far = np.hypot(x, y).max(1) + pad
        highest = np.maximum(np.abs(z_low), np.abs(z_high))
        near = np.sqrt(np.maximum(np.maximum(nearest - pad, 0) ** 2 - highest**2, 1e-6))
        low = np.arctan2(z_low, np.where(z_low < 0, near, far))
        high = np.arctan2(z_high, np.where(z_high > 0, near, far))
        low_row = np.floor((low - self._lowest) / _ELEVATION_BIN_RAD).astype(np.int64)
        high_row = np.floor((high - self._lowest) / _ELEVATION_BIN_RAD).astype(np.int64)

        centre = np.arctan2(y.mean(1), x.mean(1))
        off = np.angle(np.exp(1j * (np.arctan2(y, x) - centre[:, None])))
        margin = np.arcsin(np.minimum(pad / np.maximum(near, pad), 1))
        around = (near <= pad * 2) | (np.ptp(off, axis=1) > np.pi * 0.9)
        left = np.where(around, -np.pi, centre + off.min(1) - margin)
        width = np.where(around, 2 * np.pi - 1e-9, np.minimum(np.ptp(off, axis=1) + 2 * margin, 2 * np.pi - 1e-9))
        scale = _AZIMUTH_BINS / (2 * np.pi)
        turned = np.mod(left + np.pi, 2 * np.pi) * scale
        first = np.floor(turned).astype(np.int64) % _AZIMUTH_BINS
        last = np.minimum(first + np.floor(turned % 1 + width * scale).astype(np.int64), first + _AZIMUTH_BINS - 1)
        return np.clip(low_row, 0, None), np.clip(high_row, None, self._rows - 1), first, last
