"""Noise that is fixed in space: the same place gives the same value, and near places give similar ones.

A cube of 128³ cells holds a Gaussian random field whose spectrum falls with a power of the wave number, so that one
look-up gives six octaves. It is periodic: fields with large cells hide the repetition of fields with small ones.
"""

from __future__ import annotations

from functools import cache

import numpy as np

CELLS = 128
_SPECTRAL_SLOPE = 3.0  # of the power in three dimensions: equal variance in every octave
_SEED = 905


def field_at(points: np.ndarray, cell_m: float, offset: tuple[int, int, int] | np.ndarray = (0, 0, 0)) -> np.ndarray:
    """Values of the field, (n,) float32 with mean 0 and variance 1 over space.

    Args:
        points: (n, 3) positions [m].
        cell_m: size of a cell: features are 2 to 128 cells large.
        offset: cells by which the field is shifted, (3,) or (n, 3): other offsets give other fields.
    """
    shift = np.asarray(offset)
    flat = np.zeros(len(points), np.int32)
    scale = np.float32(1 / cell_m)
    for axis in range(3):
        cell = np.floor(points[:, axis].astype(np.float32) * scale).astype(np.int32)
        cell += shift[..., axis].astype(np.int32)
        cell &= CELLS - 1
        flat = flat * np.int32(CELLS) + cell
    return _table().take(flat)


@cache
def _table() -> np.ndarray:
    """(CELLS³,) float32."""
    rng = np.random.default_rng(_SEED)
    white = np.fft.rfftn(rng.standard_normal((CELLS,) * 3, np.float32))
    whole, half = np.fft.fftfreq(CELLS), np.fft.rfftfreq(CELLS)
    wave = np.sqrt(whole[:, None, None] ** 2 + whole[None, :, None] ** 2 + half[None, None, :] ** 2)
    wave[0, 0, 0] = 1
    white *= (wave ** (-_SPECTRAL_SLOPE / 2)).astype(np.float32)
    white[0, 0, 0] = 0
    values = np.fft.irfftn(white, s=(CELLS,) * 3, axes=(0, 1, 2))
    return (values / values.std()).astype(np.float32).ravel()
