"""How large the largest of many sums would be if their parts had random signs (Westfall and Young 1993: max-T)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

_TILTS = 60


def family_wise(
    clusterings: Sequence[tuple[Sequence[np.ndarray], np.ndarray]],
    one_sided: np.ndarray,
    draws: int,
    level: float,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, float]:
    """Equivalent normal deviates (k,), family-wise p-values (k,), and the deviate that p = `level` takes.

    Args:
        clusterings: of each kind: k tables (clusters, columns) of sums, and (k,) how much wider these scatter than
            random signs tell. The less favourable kind counts.
        one_sided: (k,) bool: only positive sums of a table of one column count.
        draws: sign patterns.
        level: see above.
        rng: for the signs.
    """
    values, p_values, critical = np.full(len(one_sided), np.inf), np.zeros(len(one_sided)), 0.0
    for tables, wider in clusterings:
        columns = np.array([table.shape[1] for table in tables])
        ends = np.cumsum(columns)
        starts = ends - columns
        z = _drawn(tables, draws, rng)
        z[0] /= np.repeat(wider, columns)
        for place, table in zip(starts, tables, strict=True):
            if table.shape[1] == 1:
                z[:, place] = deviates(z[:, place], table[:, 0])
        drawn = np.where(one_sided, z[:, starts], _sizes(z, starts, ends))
        # Each in terms of its own scatter, so that none has a head start.
        drawn = (drawn - drawn[1:].mean(0)) / np.maximum(drawn[1:].std(0), 1e-12)
        largest = np.sort(drawn[1:].max(1))
        found = drawn[0]
        p = 1 - np.searchsorted(largest, found, side="left") / draws
        p_values = np.maximum(p_values, np.maximum(p, 1 / (draws + 1)))
        values = np.minimum(values, found)
        critical = max(critical, float(largest[int((1 - level) * draws)]))
    return values, p_values, critical


def _drawn(clustered: Sequence[np.ndarray], draws: int, rng: np.random.Generator) -> np.ndarray:
    """Studentised sums, (1 + draws, columns): the true ones, then with random signs of the clusters.

    Tables of the same clusters share their signs.
    """
    parts: list[np.ndarray | None] = [None] * len(clustered)
    for size in sorted({len(one) for one in clustered}):
        mine = [place for place, one in enumerate(clustered) if len(one) == size]
        table = np.hstack([clustered[place] for place in mine])
        spread = np.sqrt((table**2).sum(0))
        table = table / np.where(spread > 0, spread, 1)
        used = np.flatnonzero(np.abs(table).sum(1))
        signs = rng.choice((-1.0, 1.0), (draws, len(used)))
        z = np.vstack([table.sum(0)[None], signs @ table[used]])
        ends = np.cumsum([clustered[place].shape[1] for place in mine])
        for place, columns in zip(mine, np.split(z, ends[:-1], axis=1), strict=True):
            parts[place] = columns
    return np.hstack([part for part in parts if part is not None])


def deviates(z: np.ndarray, sums: np.ndarray) -> np.ndarray:
    """How unlikely studentised sums (m,) are with random signs, as normal deviates.

    Of few or unequal clusters even sums that all agree make no large z, though they hardly ever all agree by chance.
    That is the large-deviation rate of the signs (Chernoff, Ann. Math. Stat. 1952): r = √(2(tz − Σ log cosh t·s)),
    where t makes z = Σ s·tanh t·s; of many equal clusters r = z.
    """
    share = np.abs(sums[sums != 0])
    if not len(share):
        return z
    share = share / np.sqrt((share**2).sum())
    tilt = np.geomspace(0.05, 1e4, _TILTS)
    tilted = tilt[:, None] * share
    reached = np.tanh(tilted) @ share
    cumulant = (tilted + np.log1p(np.exp(-2 * tilted)) - np.log(2)).sum(1)
    rate = np.sqrt(np.maximum(2 * (tilt * reached - cumulant), 0))
    return np.sign(z) * np.interp(np.abs(z), np.append(0, reached), np.append(0, rate))


def _sizes(z: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Sizes of groups of columns: |z| of one, the root of the mean square of several."""
    return np.sqrt(np.add.reduceat(z**2, starts, axis=1) / (ends - starts))
