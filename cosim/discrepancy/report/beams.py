"""What pages show of judged frames: residuals of beams before and after, and what they may depend on."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.budget import PARTS, AlignedFrame, Judged
from cosim.discrepancy.dictionary.covariates import sample_covariates
from cosim.discrepancy.scores import CLIP_M, FrameScores, Totals
from cosim.discrepancy.settings import Settings


@dataclass(frozen=True)
class Layout:
    """Numbers of pictures and tables; none of them decides what is found."""

    bins: int = 20  # of a covariate; each of a pair has `pair_bins`
    pair_bins: int = 8
    names: int = 8  # of categories in a chart, the most common ones
    fewest: int = 50  # rows in a bin, and in one of a pair `fewest_in_cell`
    fewest_in_cell: int = 30
    sweeps: int = 4  # that take off what each of a pair does alone
    dots: int = 40  # in a chart, more are a line alone
    alike: float = 0.02  # share of the largest size within which charts stand in their usual order
    common: float = 0.02  # share of rows from which a bin takes part in the scale of a chart
    excess: float = 0.05  # share of the excess from which a channel is worth a word
    told: float = 5e-4  # of an error: less is told as 0.000
    unexplained: int = 6  # charts of what is left
    sigmas: float = 4.0  # to which noise is drawn
    values: int = 9  # of an unknown dependence on categories
    scans: int = 3  # shown whole
    beams: int = 60_000  # of each, so that a page stays below 4 MB
    rows: int = 30_000  # of each judging frame in charts
    sectors: int = 12  # of azimuth: what beams of a frame share once its pose is fitted ends there, as objects do
    largest_square: float = 25.0  # of a residual over its spread
    cut_off: float = 3.0  # standard deviations from a limit of intensity


LAYOUT = Layout()


MATCHED, AMBIGUOUS, DROPPED, SPURIOUS, UNFORESEEN, SILENT = range(6)
_OF_SCANS = {
    "frame_time": ("time_s", "s"),
    "speed": ("speed_mps", "m/s"),
    "acceleration": ("acceleration_mps2", "m/s²"),
    "yaw_rate": ("yaw_rate_radps", "rad/s"),
}


@dataclass(frozen=True, eq=False)
class Column:
    """A covariate of n beams.

    Attributes:
        unit: of its values; empty for pure numbers and names.
        values: (n,) float32, NaN where it is not known; numbers of categories for names.
        names: of the categories by number; empty for numbers.
    """

    unit: str
    values: np.ndarray
    names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Rows:
    """Beams of all judged frames.

    Attributes:
        covariates: by name, (n,) each.
        cluster: (n,) number of the frame's sector: what shares errors once poses are taken out.
        before_cluster: (n,) the same before; that of the frame where poses are in the residuals.
        frame: (n,) number of the frame.
        before, after: by channel, (n,) measured − expected; NaN where it is not compared. Ranges [m] are clipped at
            1 m; intensities are left out where another material may have been met or the sensor cuts them off; `drop`
            is returned (1 or 0) − its probability; `spurious` is 1 for a return from nowhere − the chance of one;
            `range_variance` and `intensity_variance` are squares over stated variances − 1.
        settings: those that frames were traced with.
    """

    covariates: dict[str, Column]
    cluster: np.ndarray
    before_cluster: np.ndarray
    frame: np.ndarray
    before: dict[str, np.ndarray]
    after: dict[str, np.ndarray]
    settings: Settings


@dataclass(frozen=True, eq=False)
class Side:
    """One frame as one model sees it.

    Attributes:
        error: of the frame; NaN where nothing can be compared.
        state: (n,) uint8, one of MATCHED … SILENT.
        residuals: by channel, as in `Rows`, of range, intensity and drop.
    """

    error: float
    state: np.ndarray
    residuals: dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Scan:
    """One frame, whole.

    Attributes:
        name: of the frame.
        rings, firings: its layout; beams are ring-major.
        elevation_rad, azimuth_rad: (rings,) of each ring, the latter of its first firing.
        measured_m: (n,) range; NaN where nothing returned.
        covariates: (n,) each, as in `Rows`.
        before, after: what two models say.
    """

    name: str
    rings: int
    firings: int
    elevation_rad: np.ndarray
    azimuth_rad: np.ndarray
    measured_m: np.ndarray
    covariates: dict[str, Column]
    before: Side
    after: Side


@dataclass(frozen=True, eq=False)
class Beams:
    """All that a page shows of judged frames.

    Attributes:
        rows: for charts.
        scans: frames shown whole, the worst first.
        is_one: whether before and after are the same.
    """

    rows: Rows
    scans: tuple[Scan, ...]
    is_one: bool

    @classmethod
    def of(cls, judged: Judged, shown: int, seed: int = 0) -> Beams:
        """Those of judged frames, of which `shown` are kept whole; `seed` is that of the choice of rows."""
        has_poses = "poses" not in judged.before_parts
        parts: list[Rows] = []
        errors: list[float] = []
        for number, (before, after) in enumerate(judged.pairs()):
            parts.append(_rows(before, after, number, np.random.default_rng([seed, number]), has_poses))
            errors.append(Totals.of(before.frame, before.scores).error)
        kept = _shown(errors, shown)
        scans = [_scan(before, after) for number, (before, after) in enumerate(judged.pairs()) if number in kept]
        scans.sort(key=lambda scan: -np.nan_to_num(scan.before.error))
        same = judged.before is judged.after and judged.before_parts == PARTS
        return cls(_joined(parts), tuple(scans), same)


def _shown(errors: Sequence[float], count: int) -> Collection[int]:
    """Numbers of the worst frame and of others evenly spread; a frame with nothing to compare has no error."""
    worst = int(np.argmax(np.nan_to_num(np.array(errors))))
    spread = np.unique(np.linspace(0, len(errors) - 1, max(count, 1)).round().astype(int)).tolist()
    others = [number for number in spread if number != worst]
    return {worst, *others[: count - 1]}


def residuals_of(one: AlignedFrame) -> dict[str, np.ndarray]:
    """(n,) of every channel, see `Rows`."""
    scores, expected, hits = one.scores, one.expected, one.frame.shot.hits
    clear = ~scores.ambiguous
    reach = (
        LAYOUT.cut_off * expected.intensity_sigma
    )  # what is cut off at 0 or 1 is darker or brighter than it would be
    inside = (expected.intensity - reach >= 0) & (expected.intensity + reach <= 1)
    lit = scores.matched & np.isfinite(scores.intensity_score) & ~one.mixed & (inside | (reach <= 0))
    range_m = np.clip(scores.measured_m - expected.range_m, -CLIP_M, CLIP_M)
    bright = scores.measured_intensity - expected.intensity
    returned = (~np.isnan(scores.measured_m)).astype(np.float32)
    found = {
        "range": np.where(scores.matched, range_m, np.nan),
        "intensity": np.where(lit, bright, np.nan),
        "drop": np.where(clear & hits.solid.exists, returned - expected.seen, np.nan),
        "spurious": np.where(clear, scores.spurious - scores.stray, np.nan),
        "range_variance": _excess(range_m, expected.range_sigma_m, scores.matched),
        "intensity_variance": _excess(bright, expected.intensity_sigma, lit),
    }
    return {name: values.astype(np.float32) for name, values in found.items()}


def _excess(residual: np.ndarray, sigma: np.ndarray, used: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        square = np.minimum((residual / sigma) ** 2, LAYOUT.largest_square) - 1
    return np.where(used & (sigma > 0), square, np.nan)


def columns_of(one: AlignedFrame, number: int = 0) -> dict[str, Column]:
    """(n,) of everything that residuals of a frame's beams may depend on; `number` is the frame's."""
    count = len(one.sample)
    found: dict[str, Column] = {}
    for covariate in sample_covariates(one.sample, one.prediction, (one.frame,)):
        values = covariate.values.astype(np.float32)
        if covariate.labels and covariate.name != "ring":
            values = np.where(covariate.index >= 0, values, np.nan).astype(np.float32)
            names = dict(zip(covariate.centres.astype(int).tolist(), covariate.labels, strict=True))
            words = tuple(names.get(code, "") for code in range(max(names) + 1))
            found[covariate.name] = Column(covariate.unit, values, words)
        else:
            found[covariate.name] = Column(covariate.unit, values)
    for name, (value, unit) in _OF_SCANS.items():
        found[name] = Column(unit, np.full(count, one.sample.scan_values[value][0], np.float32))
    found["scan"] = Column("", np.full(count, number, np.float32))
    return found


def _rows(before: AlignedFrame, after: AlignedFrame, number: int, rng: np.random.Generator, has_poses: bool) -> Rows:
    count = len(after.sample)
    used = np.sort(rng.choice(count, min(count, LAYOUT.rows), replace=False))
    sector = np.floor((after.sample.azimuth[used] + np.pi) / (2 * np.pi) * LAYOUT.sectors).astype(int) % LAYOUT.sectors
    told = columns_of(after, number)
    return Rows(
        covariates={name: Column(one.unit, one.values[used], one.names) for name, one in told.items()},
        cluster=number * LAYOUT.sectors + sector,
        before_cluster=np.full(len(used), number) if has_poses else number * LAYOUT.sectors + sector,
        frame=np.full(len(used), number),
        before={name: values[used] for name, values in residuals_of(before).items()},
        after={name: values[used] for name, values in residuals_of(after).items()},
        settings=after.frame.settings,
    )


def _joined(parts: Sequence[Rows]) -> Rows:
    names = dict.fromkeys(name for rows in parts for name in rows.covariates)
    return Rows(
        covariates={name: _one_column([rows.covariates.get(name) for rows in parts], parts) for name in names},
        cluster=np.concatenate([rows.cluster for rows in parts]),
        before_cluster=np.concatenate([rows.before_cluster for rows in parts]),
        frame=np.concatenate([rows.frame for rows in parts]),
        before={name: np.concatenate([rows.before[name] for rows in parts]) for name in parts[0].before},
        after={name: np.concatenate([rows.after[name] for rows in parts]) for name in parts[0].after},
        settings=parts[0].settings,
    )


def _one_column(columns: Sequence[Column | None], parts: Sequence[Rows]) -> Column:
    """Of all frames; categories have the numbers that they have in `joined_names`."""
    told = [one for one in columns if one is not None]
    words = joined_names(told)
    values = [
        np.full(len(rows.frame), np.nan, np.float32) if one is None else renumbered(one, words)
        for one, rows in zip(columns, parts, strict=True)
    ]
    return Column(told[0].unit, np.concatenate(values), words)


def joined_names(columns: Sequence[Column]) -> tuple[str, ...]:
    """Names of the categories of several columns, each once; by number where they are the same in all."""
    longest = max(columns, key=lambda one: len(one.names)).names
    if all(not a or not b or a == b for one in columns for a, b in zip(one.names, longest, strict=False)):
        words = list(longest)
        for one in columns:
            for place, word in enumerate(one.names):
                words[place] = words[place] or word
        return tuple(words)
    return tuple(sorted({word for one in columns for word in one.names if word}))


def renumbered(column: Column, words: tuple[str, ...]) -> np.ndarray:
    """(n,) values of a column with the numbers that categories have among `words`."""
    if not words:
        return column.values
    number = {word: place for place, word in enumerate(words)}
    places = np.array([number.get(word, np.nan) if word else np.nan for word in column.names] + [np.nan], np.float32)
    code = np.where(np.isfinite(column.values), column.values, len(column.names)).astype(int)
    return places[np.minimum(code, len(column.names))]


def _scan(before: AlignedFrame, after: AlignedFrame) -> Scan:
    pattern, rays = after.frame.shot.pattern, after.frame.observed.rays
    first = np.arange(pattern.rings) * pattern.firings
    direction = rays.direction[first].astype(float)
    fan = np.radians(np.array(pattern.azimuth_offset_deg, float))
    return Scan(
        name=after.frame.name,
        rings=pattern.rings,
        firings=pattern.firings,
        elevation_rad=np.arcsin(np.clip(direction[:, 2], -1, 1)),
        azimuth_rad=np.pi - np.pi / pattern.firings + fan,
        measured_m=after.scores.measured_m,
        covariates=columns_of(after),
        before=_side(before),
        after=_side(after),
    )


def _side(one: AlignedFrame) -> Side:
    found = residuals_of(one)
    kept = {name: found[name] for name in ("range", "intensity", "drop")}
    return Side(Totals.of(one.frame, one.scores).error, state_of(one.scores), kept)


def state_of(scores: FrameScores) -> np.ndarray:
    """(n,) uint8 of MATCHED … SILENT."""
    returned = ~np.isnan(scores.measured_m)
    state = np.full(len(returned), SILENT, np.uint8)
    state[returned] = UNFORESEEN
    state[~returned & (scores.expected > 0.5)] = DROPPED
    state[scores.matched] = MATCHED
    state[scores.spurious] = SPURIOUS
    state[scores.ambiguous & (returned | (scores.expected > 0))] = AMBIGUOUS
    return state
