"""What a page shows of a comparison, gathered frame by frame: rows for charts, and whole scans for pictures."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from cosim.discrepancy.compare import Totals
from cosim.discrepancy.data.frames import TracedFrame, in_order
from cosim.discrepancy.forward.expectation import Expectation, expect
from cosim.discrepancy.scores import CLIP_M, FrameScores
from sensors.effects.base import Effect

MATCHED, AMBIGUOUS, DROPPED, SPURIOUS, UNFORESEEN, SILENT = range(6)
_ROWS_A_FRAME = 20_000


@dataclass(frozen=True, eq=False)
class Rows:
    """Beams of many frames.

    Attributes:
        covariates: (n,) by name, in the units of `COVARIATES`.
        frame: (n,) number of the frame, the cluster of errors that beams share.
        range_m: (n,) measured − predicted range, clipped at 1 m; NaN where not matched.
        intensity: (n,) measured − predicted; NaN where not matched.
        drop: (n,) returned (1 or 0) − predicted chance of it; NaN where ambiguous or nothing is there.
        materials: names by number.
    """

    covariates: dict[str, np.ndarray]
    frame: np.ndarray
    range_m: np.ndarray
    intensity: np.ndarray
    drop: np.ndarray
    materials: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Scan:
    """One frame, whole.

    Attributes:
        name, error: of the frame.
        rings, firings: its layout; beams are ring-major.
        state: (n,) uint8, one of MATCHED … SILENT.
        residual_m: (n,) measured − predicted range; 0 where not matched.
        xyz: (n, 3) float32 measured points in LiDAR axes; NaN where nothing returned.
    """

    name: str
    error: float
    rings: int
    firings: int
    state: np.ndarray
    residual_m: np.ndarray
    xyz: np.ndarray


class Gathered:
    """Takes frames as `compare` does them.

    Residuals are those from what the model expects, its own chance left out: against a prediction that is noisy
    itself they would seem to depend on it.

    Args:
        effects: of the sensor.
        shown: names of the frames that are kept whole; the worst one is kept beside them.
        seed: of the choice of rows.
    """

    def __init__(self, effects: Sequence[Effect], shown: Collection[str], seed: int = 0) -> None:
        self._effects = in_order(effects)
        self._shown, self._seed = set(shown), seed
        self._rows: list[Rows] = []
        self._scans: dict[str, Scan] = {}
        self._worst: Scan | None = None

    def __call__(self, frame: TracedFrame, scores: FrameScores) -> None:
        """Add a frame."""
        number = len(self._rows)
        expected = expect(self._effects, frame.shot)
        self._rows.append(_rows(frame, scores, expected, number, np.random.default_rng([self._seed, number])))
        error = Totals.of(frame, scores).error
        if frame.name in self._shown or self._worst is None or error > self._worst.error:
            scan = _scan(frame, scores, expected, error)
            if frame.name in self._shown:
                self._scans[frame.name] = scan
            if self._worst is None or error > self._worst.error:
                self._worst = scan

    def rows(self) -> Rows:
        """All rows."""
        names = list(self._rows[0].covariates)
        return Rows(
            covariates={name: np.concatenate([rows.covariates[name] for rows in self._rows]) for name in names},
            frame=np.concatenate([rows.frame for rows in self._rows]),
            range_m=np.concatenate([rows.range_m for rows in self._rows]),
            intensity=np.concatenate([rows.intensity for rows in self._rows]),
            drop=np.concatenate([rows.drop for rows in self._rows]),
            materials=self._rows[-1].materials,
        )

    def scans(self) -> list[Scan]:
        """The frames that are shown, the worst first."""
        found = dict(self._scans)
        if self._worst is not None:
            found[self._worst.name] = self._worst
        return sorted(found.values(), key=lambda scan: -scan.error)


def _rows(
    frame: TracedFrame, scores: FrameScores, expected: Expectation, number: int, rng: np.random.Generator
) -> Rows:
    hits, rays = frame.shot.hits, frame.shot.rays
    clear = ~scores.ambiguous & hits.solid.exists
    used = np.flatnonzero(clear | scores.matched)
    if len(used) > _ROWS_A_FRAME:
        used = np.sort(rng.choice(used, _ROWS_A_FRAME, replace=False))
    solid = hits.solid.take(used)
    matched, outcome = scores.matched[used], (~np.isnan(scores.measured_m[used])).astype(np.float32)
    residual = np.clip(scores.measured_m[used] - expected.range_m[used], -CLIP_M, CLIP_M)
    bright = scores.measured_intensity[used] - expected.intensity[used]
    return Rows(
        covariates={
            "range": solid.range_m,
            "incidence": np.degrees(np.arccos(hits.cos_incidence(solid, used))),
            "ring": rays.ring[used],
            "azimuth": np.degrees(rays.azimuth[used]),
            "intensity": expected.intensity[used].astype(np.float32),
            "firing_time": 1000 * rays.time_s[used],
            "material": solid.material,
            "frame_time": np.full(len(used), frame.time_s),
        },
        frame=np.full(len(used), number),
        range_m=np.where(matched, residual, np.nan).astype(np.float32),
        intensity=np.where(matched, bright, np.nan).astype(np.float32),
        drop=np.where(clear[used], outcome - expected.seen[used], np.nan).astype(np.float32),
        materials=tuple(name.replace("_", " ") for name in hits.table.names),
    )


def _scan(frame: TracedFrame, scores: FrameScores, expected: Expectation, error: float) -> Scan:
    rays, pattern = frame.shot.rays, frame.shot.pattern
    returned = ~np.isnan(scores.measured_m)
    state = np.full(len(rays), SILENT, np.uint8)
    state[returned] = UNFORESEEN
    state[~returned & (scores.expected > 0.5)] = DROPPED
    state[scores.matched] = MATCHED
    state[scores.spurious] = SPURIOUS
    state[scores.ambiguous & (returned | (scores.expected > 0))] = AMBIGUOUS
    residual = np.nan_to_num(np.where(state == MATCHED, scores.measured_m - expected.range_m, 0))
    return Scan(
        name=frame.name,
        error=error,
        rings=pattern.rings,
        firings=pattern.firings,
        state=state,
        residual_m=residual.astype(np.float32),
        xyz=(rays.origin + rays.direction * scores.measured_m[:, None]).astype(np.float32),
    )
