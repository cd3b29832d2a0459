"""What a diagnosis knows: its drive traced, the model as it stands, what has been found; and how it fits that anew."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.discrepancy.data.frames import FrameTracer, TracedFrame, bending, in_order
from cosim.discrepancy.data.sample import Sample, draw_sample
from cosim.discrepancy.data.split import Split, split_drive
from cosim.discrepancy.diagnosis import Alternative, Finding
from cosim.discrepancy.gate import Verdict
from cosim.discrepancy.groups.quantization import Lattice
from cosim.discrepancy.inference.fit import Fitted, Fitter, Free, all_free
from cosim.discrepancy.kinds import candidate_kinds, with_rings
from cosim.discrepancy.settling import Settled, settle
from cosim.discrepancy.twin_scatter import with_scatter
from cosim.discrepancy.unknown import Shape, effect_name
from cosim.discrepancy.validation import HeldOut, held_out_errors
from cosim.drives.kitti import Drive
from sensors.effects.base import Effect
from sensors.sensor_model import SensorModel, load_sensor


@dataclass(frozen=True)
class Model:
    """The sensor as it stands: its effects, and which of them have been fitted here."""

    effects: tuple[Effect, ...]
    fitted: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Look:
    """The model fitted once more, and whether anything is missing still."""

    fitter: Fitter
    fitted: Fitted
    lattices: Sequence[Lattice]
    verdict: Verdict


class Inquiry:
    """The state of one diagnosis.

    Attributes:
        drive, sensor: as they were given.
        split: which frames are fitted, and which judge.
        kinds: the candidates.
        seed: of samples and signs.
        say: is told what is being done.
        frames: traced as the model bends their beams.
        given: the sensor's own effects.
        model: as it stands.
        findings, unknown: what has been added.
        errors: on the judging frames, after each step.
        ranking: candidates of the first round.
        refused: names of those that did not help.
        found_map_off: whether the map has been found to be off.
    """

    def __init__(
        self,
        drive: Drive,
        sensor: SensorModel | str | Path,
        extra: Sequence[type[Effect]],
        seed: int,
        say: Callable[[str], None],
    ) -> None:
        self.drive = drive
        self.sensor = sensor if isinstance(sensor, SensorModel) else load_sensor(sensor)
        self.split: Split = split_drive(drive)
        self.kinds = candidate_kinds(extra, self.sensor.pattern.rings)
        self.seed, self.say = seed, say
        self.tracer = FrameTracer(drive, self.sensor)
        self.frames: list[TracedFrame] = []
        self.given = with_rings(in_order(self.sensor.effects), self.sensor.pattern.rings)
        self.model = Model(self.given)
        self.findings: list[Finding] = []
        self.unknown: Shape | None = None
        self.errors: list[HeldOut] = []
        self.ranking: list[Alternative] = []
        self.refused: set[str] = set()
        self.found_map_off = False

    def unknown_place(self) -> int | None:
        """Where the unknown shape stands among the effects."""
        name = effect_name(self.unknown) if self.unknown is not None else ""
        return next((place for place, effect in enumerate(self.model.effects) if effect.name == name), None)

    def held_out(self) -> HeldOut:
        """Errors on the frames that judge."""
        return held_out_errors(self.tracer, self.split.test, self.model.effects, self.sensor.origin)

    def trace(self) -> None:
        """Trace the frames that are fitted, as the model bends their beams."""
        self.say("tracing the twin")
        self.frames = self.traced(bending(self.model.effects))

    def traced(self, bending: tuple[Effect, ...], leaning: np.ndarray | None = None) -> list[TracedFrame]:
        """The same frames, as effects bend their beams, from poses off by (scans, 6), the twin as sure as is known."""
        frames = self.tracer.trace_all(self.split.fit, bending, leaning)
        return with_scatter(frames, self.frames[0].scatter) if self.frames else frames

    def sample(self, rows: int) -> Sample:
        """About so many of their beams."""
        return draw_sample(self.frames, rows, np.random.default_rng([self.seed, rows]))

    def free(self) -> tuple[Free, ...]:
        """What can be fitted of the model."""
        return all_free(self.model.effects, self.model.fitted, self.sensor.pattern.rings)

    def with_effect(self, place: int, effect: Effect) -> tuple[Effect, ...]:
        """The model's effects with another one in a place."""
        return (*self.model.effects[:place], effect, *self.model.effects[place + 1 :])

    def fitted_anew(self, pose: np.ndarray | None = None) -> Settled:
        """The model fitted to frames traced as it bends their beams, starting from pose errors."""
        found = settle(self.frames, self.traced, self.model.effects, self.free(), self.seed, pose, self.model.fitted)
        self.frames, self.model = found.frames, replace(self.model, effects=found.fitted.effects)
        return found

    def said(self, place: int) -> Effect | None:
        """The effect as the sensor had it; None if it did not."""
        return self.given[place] if place < len(self.given) else None
