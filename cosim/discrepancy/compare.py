"""Error of a sensor model against measurements, and where it is largest."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.analysis import Context, candidates_for, split_for, trace_and_fit
from cosim.discrepancy.budget import AS_GIVEN, Budget, FramePairs
from cosim.discrepancy.data.checks import check_fit, drive_notes, opened
from cosim.discrepancy.data.frames import FrameTracer, TracedFrame
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.data.wiring import Exchange, exchange_notes, exchanged_rings
from cosim.discrepancy.forward.reflectances import solve_reflectances
from cosim.discrepancy.held_out import check_held_out
from cosim.discrepancy.missing import find_missing
from cosim.discrepancy.noise_floor import NeighbourPairs, NoiseFloor, estimate_floor
from cosim.discrepancy.scores import SCALES, FrameScores, Totals, model_chance, score_frame
from cosim.discrepancy.selection.refit import FittedModel
from cosim.discrepancy.settings import DEFAULT, Settings
from cosim.discrepancy.words import source_words, times
from cosim.drives.kitti import Drive
from cosim.variants.worth import Worth
from sensors.effects.acting import bending, in_order
from sensors.effects.base import Effect
from sensors.effects.expectation import expect
from sensors.sensor_model import SensorModel, load_sensor

_RANGES_M = (0, 10, 20, 30, 45, 60, 80, 1000)
_REACHES = len(_RANGES_M) - 1
_RING_BAND, _BANDS = 16, 4
_FEWEST = 300
_SHOWN = 12
_WIRING_FRAMES = 3  # in which exchanged lasers are searched


@dataclass(frozen=True)
class Slice:
    """Beams with something in common.

    Attributes:
        where: in words.
        channel: range, intensity or drop.
        beams: how many.
        bias, spread: mean and standard deviation of the residual, measured − model, in the channel's unit.
        share: of the channel's part of the error that arises here.
    """

    where: str
    channel: str
    beams: int
    bias: float
    spread: float
    share: float

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)

    def __str__(self) -> str:
        if self.channel == "range":
            return f"{self.where}: {self.bias * 100:+.1f} cm"
        if self.channel == "drop":
            return f"{self.where}: {self.bias:+.0%} returns"
        return f"{self.where}: intensity {self.bias:+.3f}"


class SliceTally:
    """Sums of residuals by slice over frames."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()
        self._rings = 0
        # for each material, band of rings and band of ranges: count, sums of residuals, of their squares and of scores
        self._sums: dict[str, np.ndarray] = {channel: np.zeros((0, 4)) for channel in ("range", "intensity", "drop")}

    def add(self, frame: TracedFrame, scores: FrameScores) -> None:
        """Add a frame."""
        solid, ring = frame.shot.hits.solid, frame.shot.rays.ring
        self._names = max(self._names, frame.shot.hits.table.names, key=len)
        self._rings = frame.shot.pattern.rings
        band = np.minimum(ring // _RING_BAND, _BANDS - 1)
        reach = np.searchsorted(_RANGES_M[1:], np.nan_to_num(solid.range_m, posinf=999.0), side="right")
        key = (solid.material.astype(int) * _BANDS + band) * _REACHES + reach
        residual = scores.measured_m - scores.range_m
        bright = scores.measured_intensity - scores.intensity
        outcome = (~np.isnan(scores.measured_m)).astype(float) - scores.expected
        lit = scores.matched & np.isfinite(scores.intensity_score)
        clear = ~scores.ambiguous & solid.exists
        for channel, rows, values, score in (
            ("range", scores.matched, residual, scores.range_score),
            ("intensity", lit, bright, scores.intensity_score),
            ("drop", clear, outcome, scores.brier),
        ):
            keys, own = key[rows], values[rows].astype(np.float64)
            columns = (None, own, own**2, np.nan_to_num(score[rows].astype(np.float64)))
            size = max(len(self._names) * _BANDS * _REACHES, len(self._sums[channel]))
            sums = np.stack([np.bincount(keys, column, size) for column in columns], 1, dtype=float)
            sums[: len(self._sums[channel])] += self._sums[channel]
            self._sums[channel] = sums

    def worst(self) -> tuple[Slice, ...]:
        """Slices with a significant bias, by their share of the error."""
        found = []
        for channel, sums in self._sums.items():
            weight, _, _, total = sums.sum(0) if len(sums) else np.zeros(4)
            for key in np.flatnonzero(sums[:, 0] >= _FEWEST).tolist():
                count, one, two, cost = sums[key].tolist()
                bias = one / count
                spread = float(np.sqrt(max(two / count - bias**2, 0)))
                weighted = abs(bias) / SCALES[channel] * count / weight
                found.append(
                    (weighted, Slice(self._words(key), channel, int(count), bias, spread, cost / (total or 1.0)))
                )
        found.sort(key=lambda row: -row[0])
        return tuple(one for _, one in found[:_SHOWN])

    def _words(self, key: int) -> str:
        material, band, reach = np.unravel_index(key, (len(self._names), _BANDS, _REACHES))
        name = self._names[material].replace("_", " ")
        low, high = _RANGES_M[reach], _RANGES_M[reach + 1]
        far = f"beyond {low} m" if high == _RANGES_M[-1] else f"at {low}–{high} m"
        if self._rings <= _RING_BAND:
            return f"{name} {far}"
        last = self._rings - 1 if band == _BANDS - 1 else min(band * _RING_BAND + _RING_BAND, self._rings) - 1
        return f"rings {band * _RING_BAND}–{last} on {name} {far}"


_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of a sensor model with a drive.

    Attributes:
        drive, sensor: names of drive and sensor for display.
        totals: of all frames.
        by_frame: of each.
        floor: the error of a model that is right up to noise, and how it is known; None where it is not.
        slices: where residuals are worst.
        notes: what could not be known, a sentence each.
        budget: sources of the error; None if not requested.
        scores: of each frame, beam by beam, if they were to be kept.
        frame_pairs: the frames of the budget at the poses as given and aligned, for pages.
        worth: what the model's effects are worth to a detector, where one was asked.
        settings: numbers that decide.
    """

    drive: str
    sensor: str
    totals: Totals
    by_frame: dict[str, Totals]
    floor: NoiseFloor | None
    slices: tuple[Slice, ...]
    notes: tuple[str, ...]
    budget: Budget | None = None
    scores: Mapping[str, FrameScores] = field(default_factory=dict)
    frame_pairs: FramePairs | None = None
    worth: Worth | None = None
    settings: Settings = DEFAULT

    @property
    def error(self) -> float:
        """The one number to watch; lower is better."""
        return self.totals.error

    @property
    def at_floor(self) -> bool:
        """Whether the error equals the noise floor, within 2 % and a thousandth of a scale, and no effect is missing.

        If alignment more than halves the error, the aligned error counts, within 5 %, because fits are never exact.
        """
        if self.budget is not None and self.budget.has_findings:
            return False
        if self.budget is not None and self.budget.floor is not None and self.error > 2 * self.budget.given_aligned:
            return self._is_aligned_at_floor(self.budget)
        return self.floor is not None and self.error <= self.settings.near * self.floor.error + self.settings.negligible

    def _is_aligned_at_floor(self, budget: Budget) -> bool:
        return budget.floor is None or budget.given_aligned <= (1 + self.settings.at_floor) * budget.floor

    @property
    def parts(self) -> dict[str, float]:
        """Sources of the error, which add up to it; empty if not requested."""
        return {} if self.budget is None else self.budget.scaled_to(self.error)

    @property
    def error_aligned(self) -> float | None:
        """The error with poses, objects and surfaces where a fit has them."""
        return None if self.budget is None else self.budget.given_aligned

    @property
    def excess(self) -> dict[str, float]:
        """Excess of each channel above its floor, in units of its scale, largest first."""
        parts, floor = self.totals.parts(), self.floor.parts if self.floor else {}
        above = {name: max(parts[name] - floor.get(name, 0.0), 0.0) / SCALES[name] for name in parts}
        return dict(sorted(above.items(), key=lambda item: -item[1]))

    def to_json(self) -> dict[str, Any]:
        """Contents of the file of `cosim compare --json`."""
        t = self.totals
        matched, lit = max(t.matched, 1), max(t.lit, 1)
        precision = t.hit_drops / t.foreseen_drops if t.foreseen_drops > 0 else 0.0
        recall = t.hit_drops / t.dropped if t.dropped else 0.0
        f1 = 2 * precision * recall / (precision + recall) if precision + recall > 0 else 0.0
        channels: dict[str, Any] = {
            "range": {
                "rmse_m": float(np.sqrt(t.squared / matched)),
                "mae_m": t.absolute / matched,
                "bias_m": t.signed / matched,
            }
        }
        if t.lit:
            channels["intensity"] = {
                "rmse": float(np.sqrt(t.intensity_squared / lit)),
                "bias": t.intensity_signed / lit,
            }
        channels["drop"] = {"precision": precision, "recall": recall, "f1": f1}
        channels["spurious"] = {"per_frame": t.spurious / max(t.frames, 1)}
        return {
            "frames": t.frames,
            "points": t.points,
            "channels": channels,
            "error": self.error,
            "error_aligned": self.error_aligned,
            "budget": self.parts or None,
            "noise_floor": self.floor.error if self.floor else None,
            "slices": [one.to_json() for one in self.slices],
            "notes": list(self.notes),
            **({"worth": self.worth.to_json()} if self.worth else {}),
        }

    def __str__(self) -> str:
        if self.at_floor and self.floor:
            as_given = self.error <= 2 * self.floor.error
            floor = f": at the floor ({self.floor.error:.3f})" if as_given else self._sources()
            return f"error {self.error:.3f}{floor}"
        worst = f"; worst: {self.slices[0]}" if self.slices else ""
        if next(iter(self.excess), "") == "spurious":
            worst = f"; worst: {self.totals.spurious / self.totals.frames:,.0f} spurious returns a frame"
        return f"error {self.error:.3f}{self._sources()}{worst}"

    def _sources(self) -> str:
        """Excess of the error over the floor, and its sources."""
        if self.budget is not None and self.budget.floor:
            floor, aligned = self.budget.floor, self.budget.given_aligned / self.budget.floor
            made = source_words(self.parts, floor, is_complete=False)
            message = f", {times(self.error / floor)} the noise floor ({floor:.3f}){made and f': {made}'}"
            ends = "at the floor" if self._is_aligned_at_floor(self.budget) else f"{times(aligned)} the floor"
            return f"{message}; aligned {self.budget.given_aligned:.3f}, {ends}"
        return f", noise floor {self.floor.error:.3f}" if self.floor else ""


def compare(
    drive: Drive | str | Path,
    sensor: SensorModel | str | Path,
    *,
    frames: Sequence[str] | None = None,
    seed: int = 0,
    keep: bool = False,
    budget: bool = True,
    settings: Settings = DEFAULT,
    on_frame: Callable[[TracedFrame, FrameScores], None] | None = None,
) -> Comparison:
    """Compare a sensor model with a drive, beam by beam.

    Args:
        drive: with points and a twin, or its folder.
        sensor: the model, or its file.
        frames: those to use; all by default.
        seed: of the model's chance.
        budget: whether to ask where the error comes from; takes seconds.
        settings: numbers that decide.
        keep: whether the result holds what is known of every beam, about 6 MB a frame of 130 000.
        on_frame: called with the name and scores of each finished frame.

    Raises:
        CosimError: the drive has no points or no twin, or the twin does not match it.
        SensorError: the sensor file breaks the rules.
    """
    drive = opened(drive)
    model = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
    tracer = FrameTracer(drive, model, settings)
    effects = in_order(model.effects)
    names = tuple(frames) if frames is not None else drive.frames
    solve_reflectances(tracer, names)
    exchanged, early = _exclude_exchanged(tracer, names, effects)
    by_frame: dict[str, Totals] = {}
    kept: dict[str, FrameScores] = {}
    split = Split((), ())
    if budget and names:
        split = split_for(drive, model, frames, settings).thinned(settings.most_aligned)
    aligned: dict[str, TracedFrame] = {}
    tally, floor = SliceTally(), []
    for number, name in enumerate(names):
        traced = early.pop(name, None) or tracer.trace(name, bending(effects))
        if number == 0:
            check_fit(traced, drive)
        scores = score_frame(traced, effects, model_chance(seed, number), model.origin)
        by_frame[name] = Totals.of(traced, scores)
        tally.add(traced, scores)
        if keep:
            kept[name] = scores
        if name in {*split.fit, *split.test}:
            aligned[name] = traced
        expected = expect(effects, traced.shot)
        floor.append(estimate_floor(NeighbourPairs.of(traced, scores, expected), scores, expected))
        if on_frame is not None:
            on_frame(traced, scores)
    total = sum(by_frame.values(), Totals())
    made_of, frame_pairs = _budget(tracer, model, split, aligned, seed)
    return Comparison(
        drive=str(drive.root),
        sensor=model.origin,
        totals=total,
        by_frame=by_frame,
        floor=NoiseFloor.of(floor),
        slices=tally.worst(),
        notes=(
            *exchange_notes(exchanged),
            *drive_notes(
                drive, frames=total.frames, bad=total.bad, unmatched=total.unmatched, has_intensity=bool(total.lit)
            ),
        ),
        budget=made_of,
        scores=kept,
        frame_pairs=frame_pairs,
        settings=settings,
    )


def _exclude_exchanged(
    tracer: FrameTracer, names: Sequence[str], effects: Sequence[Effect]
) -> tuple[tuple[Exchange, ...], dict[str, TracedFrame]]:
    """Find exchanged lasers in some frames; as in `diagnose`, their beams are left out of the comparison.

    Returns:
        Exchanged lasers; and, by name, the frames traced for this, where they can be used as they are.
    """
    chosen = names[:: max(-(-len(names) // _WIRING_FRAMES), 1)]
    traced = {name: tracer.trace(name, bending(effects)) for name in chosen}
    exchanged = exchanged_rings(list(traced.values())) if traced else ()
    tracer.exclude_rings([one.ring for one in exchanged])
    return exchanged, {} if exchanged else traced


def _budget(
    tracer: FrameTracer,
    model: SensorModel,
    split: Split,
    traced: Mapping[str, TracedFrame],
    seed: int,
) -> tuple[Budget | None, FramePairs | None]:
    """Sources of the error of held-out frames, and these frames; None where nothing can be compared.

    What is missing is estimated as `diagnose` does, from the same frames, with fewer beams and terms.

    Args:
        tracer: of the drive.
        model: sensor that is compared.
        split: frames to fit, and held-out frames.
        traced: these frames by name, traced for the sensor.
        seed: of samples, signs and folds.
    """
    fit_frames, test_frames = ([traced[name] for name in names] for names in (split.fit, split.test))
    if not any((one.observed.returned & one.observed.trusted).any() for one in fit_frames):
        return None, None
    settings = tracer.settings
    by = replace(settings.selection, steps=settings.compare_steps)
    few = replace(settings, rows=settings.compare_rows, selection=by)
    types = candidates_for(tracer.drive, model, len(split.fit), settings)
    context = Context(model, tracer, split, types, few, seed, _LOG.debug)
    on = trace_and_fit(context, split.fit, context.initial_effects, traced=fit_frames)
    initial = FittedModel(on.frames, on.fitter, on.fitted)
    check = check_held_out(context, find_missing(context, initial), initial, traced=test_frames)
    return check.budget, replace(check.frame_pairs, before_removed=AS_GIVEN)
