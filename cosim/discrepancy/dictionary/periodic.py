"""Periodic dependences: waves per turn with a phase in each scan, and lines in absolute time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from cosim.discrepancy.dictionary.groups import Group, basis_group
from cosim.discrepancy.dictionary.linearisation import Linearisation

_STEP_S = 5e-4  # resolution of the periodogram
_LOWEST_HZ, _HIGHEST_HZ = 0.5, 950.0
_MOST_VALUES = 2**20
_FINE_GRID = 81  # frequencies about a line that are looked at


def wave_groups(linearisation: Linearisation, channel: str, waves: tuple[int, ...] = (1, 2, 3, 4)) -> Iterator[Group]:
    """Yield groups of sine waves per turn with an amplitude and phase for each scan."""
    sample, rows = linearisation.sample, np.arange(len(linearisation.sample))
    for count in waves:
        parts = [
            sparse.csr_matrix((function(count * sample.azimuth), (rows, sample.frame)), (len(rows), len(sample.names)))
            for function in (np.cos, np.sin)
        ]
        name = f"{channel} by scan: {count} waves per turn"
        yield basis_group(
            linearisation, channel, name, ("scan", "azimuth"), sparse.hstack(parts, format="csr"),
            is_clustered_by_scan=False,
        )  # fmt: skip


def absolute_time(linearisation: Linearisation) -> np.ndarray:
    """Time (n,) of each beam since the pose time of the first scan [s]."""
    sample = linearisation.sample
    start = sample.scan_values["time_s"]
    return start[sample.frame] - start.min() + sample.time_s


def line_groups(
    linearisation: Linearisation, channel: str, draws: int, level: float, rng: np.random.Generator
) -> list[Group]:
    """Find the strongest lines in the periodogram of a channel in absolute time.

    The mean over scans at each time in the turn is removed, as a pattern that repeats in each turn is not a line in
    absolute time. Reference distribution: strongest line of scans with random signs. Of lines of nearly equal
    significance (aliases), at most three with the largest amplitude are returned; a fit decides among them.

    Args:
        linearisation: linearised model.
        channel: channel whose scores are analysed.
        draws: number of sign patterns.
        level: maximum p-value.
        rng: random generator for the signs.
    """
    sample = linearisation.sample
    score, _ = linearisation.weights(channel)
    scan_time, in_turn = sample.scan_values["time_s"], sample.time_s - sample.time_s.min()
    start = scan_time - scan_time.min()
    length = float((start[sample.frame] + in_turn).max())
    size = int(2 ** np.ceil(np.log2(2 * max(length, _STEP_S) / _STEP_S)))
    if size > _MOST_VALUES or len(sample.names) < 4:
        return []
    bins = (in_turn / _STEP_S).astype(int)
    table = np.zeros((len(sample.names), int(bins.max()) + 1))
    np.add.at(table, (sample.frame, bins), score)
    table -= table.mean(0)
    hz = np.fft.rfftfreq(size, _STEP_S)
    lines = np.fft.rfft(table, size, axis=1) * np.exp(-2j * np.pi * hz * start[:, None])
    within = (hz > _LOWEST_HZ) & (hz < _HIGHEST_HZ)
    lines, hz = lines[:, within], hz[within]
    found = _find_strongest(lines, hz, length, draws, level, rng)
    return [
        line_group(
            linearisation, channel, _refine_frequency(linearisation, channel, float(hz[row]), float(hz[1] - hz[0]))
        )
        for row in found
    ]


def _find_strongest(
    lines: np.ndarray, hz: np.ndarray, length_s: float, draws: int, level: float, rng: np.random.Generator
) -> list[int]:
    own = (np.abs(lines) ** 2).sum(0)
    if not own.any():
        return []
    middle = float(np.median(own))
    independent = max((hz[-1] - hz[0]) * length_s, 2.0)
    signs = rng.choice((-1.0, 1.0), (draws, len(lines))).astype(np.float32)
    best: tuple[float, np.ndarray] | None = None
    for used in (own > 0, own > 2 * middle):
        power = np.where(used, np.abs(lines.sum(0)) ** 2 / np.maximum(own, middle), 0.0)
        if not used.any() or power.max() < np.log(independent) - 0.5:
            continue  # noise would have an equally strong line
        scaled = (lines[:, used] / np.sqrt(np.maximum(own[used], middle))).astype(np.complex64)
        largest = np.concatenate(
            [(np.abs(signs[first : first + 50] @ scaled) ** 2).max(1) for first in range(0, draws, 50)]
        )
        p = (1 + np.count_nonzero(largest >= power.max())) / (draws + 1)
        if best is None or p < best[0]:
            best = p, power
    if best is None or best[0] > level:
        return []
    size = np.where(best[1] > 0.6 * best[1].max(), np.abs(lines.sum(0)), 0.0)
    found = []
    while len(found) < 3 and size.max() > 0:
        found.append(int(np.argmax(size)))
        size[np.abs(hz - hz[found[-1]]) < _LOWEST_HZ] = 0.0
    return found


def line_group(linearisation: Linearisation, channel: str, frequency_hz: float) -> Group:
    """Build the group of cosine and sine of a frequency in absolute time."""
    turn = 2 * np.pi * frequency_hz * absolute_time(linearisation)
    basis = sparse.csr_matrix(np.stack([np.cos(turn), np.sin(turn)], 1))
    name = f"{channel} at {frequency_hz:.2f} Hz"
    return basis_group(linearisation, channel, name, ("time",), basis, frequency_hz=frequency_hz)


def _refine_frequency(linearisation: Linearisation, channel: str, hz: float, step_hz: float) -> float:
    """Refine the frequency of a line to the maximum of the periodogram nearby."""
    score, _ = linearisation.weights(channel)
    time = absolute_time(linearisation)
    fine = hz + np.linspace(-2, 2, _FINE_GRID) * step_hz
    power = [np.abs(score @ np.exp(-2j * np.pi * frequency * time)) for frequency in fine]
    return float(fine[int(np.argmax(power))])
