"""How far a sensor model is from measurements, and where."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosim.discrepancy.data.checks import check_fit, opened
from cosim.discrepancy.data.frames import FrameTracer, TracedFrame, bending, in_order
from cosim.discrepancy.data.notes import drive_notes
from cosim.discrepancy.forward.expectation import expect
from cosim.discrepancy.noise_floor import Neighbours, NoiseFloor, estimate_floor
from cosim.discrepancy.scores import SCALES, FrameScores, model_chance, score_frame
from cosim.discrepancy.slices import Slice, SliceTally
from cosim.drives.kitti import Drive
from sensors.sensor_model import SensorModel, load_sensor

_NEAR, _NEGLIGIBLE = 1.02, 0.001


@dataclass(frozen=True, eq=False)
class Totals:
    """Sums over frames from which all figures follow."""

    frames: int = 0
    points: int = 0
    beams: int = 0
    matched: int = 0
    squared: float = 0.0
    absolute: float = 0.0
    signed: float = 0.0
    range_score: float = 0.0
    lit: int = 0
    intensity_squared: float = 0.0
    intensity_signed: float = 0.0
    intensity_score: float = 0.0
    brier: float = 0.0
    dropped: int = 0
    foreseen_drops: float = 0.0
    hit_drops: float = 0.0
    spurious: int = 0
    foreseen: float = 0.0
    strays: int = 0
    bad: int = 0

    def __add__(self, other: Totals) -> Totals:
        return Totals(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))

    @classmethod
    def of(cls, frame: TracedFrame, scores: FrameScores) -> Totals:
        """Those of one frame."""
        matched = scores.matched
        residual = (scores.measured_m - scores.range_m)[matched].astype(np.float64)
        lit = matched & np.isfinite(scores.intensity_score)
        bright = (scores.measured_intensity - scores.intensity)[lit].astype(np.float64)
        clear = ~scores.ambiguous
        could = clear & (scores.expected > 0)
        missing = could & np.isnan(scores.measured_m)
        return cls(
            frames=1,
            points=frame.observed.points,
            beams=int(clear.sum()),
            matched=int(matched.sum()),
            squared=float(residual @ residual),
            absolute=float(np.abs(residual).sum()),
            signed=float(residual.sum()),
            range_score=float(scores.range_score[matched].sum()),
            lit=int(lit.sum()),
            intensity_squared=float(bright @ bright),
            intensity_signed=float(bright.sum()),
            intensity_score=float(scores.intensity_score[lit].sum()),
            brier=float(np.nansum(scores.brier)),
            dropped=int(missing.sum()),
            foreseen_drops=float((1 - scores.expected[could]).sum()),
            hit_drops=float((1 - scores.expected[missing]).sum()),
            spurious=int(scores.spurious.sum()),
            foreseen=scores.foreseen,
            strays=frame.observed.strays,
            bad=frame.observed.bad,
        )

    def parts(self) -> dict[str, float]:
        """Mean score of each channel that is present, in its own unit."""
        parts = {}
        if self.matched:
            parts["range"] = self.range_score / self.matched
        if self.lit:
            parts["intensity"] = self.intensity_score / self.lit
        if self.beams:
            parts["drop"] = self.brier / self.beams
            parts["spurious"] = abs(self.foreseen - self.spurious) / self.beams * 1000
        return parts

    @property
    def error(self) -> float:
        """The one number."""
        parts = self.parts()
        return float(np.mean([parts[name] / SCALES[name] for name in parts])) if parts else float("nan")


@dataclass(frozen=True, eq=False)
class Comparison:
    """A sensor model held against a drive.

    Attributes:
        drive, sensor: what was compared, for people.
        totals: of all frames.
        by_frame: of each.
        floor: the error of a model that is right up to noise, and how it is known; None where it is not.
        slices: where residuals are worst.
        notes: what could not be known, a sentence each.
        scores: of each frame, beam by beam, if they were to be kept.
    """

    drive: str
    sensor: str
    totals: Totals
    by_frame: dict[str, Totals]
    floor: NoiseFloor | None
    slices: tuple[Slice, ...]
    notes: tuple[str, ...]
    scores: Mapping[str, FrameScores] = field(default_factory=dict)

    @property
    def error(self) -> float:
        """The one number to watch; lower is better."""
        return self.totals.error

    @property
    def at_floor(self) -> bool:
        """Whether the error is what noise alone makes, within 2 % and a thousandth of a scale."""
        return self.floor is not None and self.error <= _NEAR * self.floor.error + _NEGLIGIBLE

    @property
    def excess(self) -> dict[str, float]:
        """How far each channel lies above its floor, in units of its scale, the farthest first."""
        parts, floor = self.totals.parts(), self.floor.parts if self.floor else {}
        above = {name: max(parts[name] - floor.get(name, 0.0), 0.0) / SCALES[name] for name in parts}
        return dict(sorted(above.items(), key=lambda item: -item[1]))

    def to_json(self) -> dict[str, Any]:
        """What `cosim compare --json` writes."""
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
            "noise_floor": self.floor.error if self.floor else None,
            "slices": [one.to_json() for one in self.slices],
            "notes": list(self.notes),
        }

    def __str__(self) -> str:
        if self.at_floor and self.floor:
            return f"error {self.error:.3f}: at the floor ({self.floor.error:.3f})"
        floor = f", noise floor {self.floor.error:.3f}" if self.floor else ""
        worst = f"; worst: {self.slices[0]}" if self.slices else ""
        if next(iter(self.excess), "") == "spurious":
            worst = f"; worst: {self.totals.spurious / self.totals.frames:,.0f} spurious points a frame"
        return f"error {self.error:.3f}{floor}{worst}"


def compare(
    drive: Drive | str | Path,
    sensor: SensorModel | str | Path,
    *,
    frames: Sequence[str] | None = None,
    seed: int = 0,
    keep: bool = False,
    on_frame: Callable[[TracedFrame, FrameScores], None] | None = None,
) -> Comparison:
    """Hold a sensor model against a drive, beam by beam.

    Args:
        drive: with points and a twin, or its folder.
        sensor: the model, or its file.
        frames: those to use; all by default.
        seed: of the model's chance.
        keep: whether the result holds what is known of every beam, about 6 MB a frame of 130 000.
        on_frame: is told each frame and its scores as they are done.

    Raises:
        CosimError: the drive lacks points or a twin, or the twin does not fit it.
        SensorError: the sensor file breaks the rules.
    """
    drive = opened(drive)
    model = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
    tracer = FrameTracer(drive, model)
    effects = in_order(model.effects)
    names = tuple(frames) if frames is not None else drive.frames
    by_frame: dict[str, Totals] = {}
    kept: dict[str, FrameScores] = {}
    tally, floor = SliceTally(), []
    for number, name in enumerate(names):
        traced = tracer.trace(name, bending(effects))
        if number == 0:
            check_fit(traced, drive)
        scores = score_frame(traced, effects, model_chance(seed, number), model.origin)
        by_frame[name] = Totals.of(traced, scores)
        tally.add(traced, scores)
        if keep:
            kept[name] = scores
        expected = expect(effects, traced.shot)
        floor.append(estimate_floor(Neighbours.of(traced, scores, expected), scores, expected))
        if on_frame is not None:
            on_frame(traced, scores)
    total = sum(by_frame.values(), Totals())
    return Comparison(
        drive=str(drive.root),
        sensor=model.origin,
        totals=total,
        by_frame=by_frame,
        floor=NoiseFloor.of(floor),
        slices=tally.worst(),
        notes=drive_notes(
            drive, frames=total.frames, bad=total.bad, strays=total.strays, has_intensity=bool(total.lit)
        ),
        scores=kept,
    )
