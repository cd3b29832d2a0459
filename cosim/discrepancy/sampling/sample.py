"""A sample of beams of a whole drive: what was measured of them, and what else they have in common."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.discrepancy.forward.joined import Replay
from cosim.discrepancy.forward.replay import Expected, FrameReplay
from cosim.discrepancy.settings import Settings
from sensors.effects.base import Effect
from sensors.effects.expectation import Expectation
from sensors.shot import Shot


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a model expects of the n beams of a sample, in the terms of what was measured.

    Attributes:
        range_m, range_sigma_m: mean and spread of the component along the beam; NaN where no surface can answer.
        rise_m: the component across it, upwards.
        intensity, intensity_sigma: mean and spread.
        seen: probability that the surface's return is reported.
        silent: probability that nothing is.
        stray: (n,) density [1/m] of returns from elsewhere at the measured range; 0 where nothing was measured.
        split: (n,) what other parts of the beam itself have of it.
        unsure_m, unsure_intensity: how far the twin itself may be off, standard deviations beside those of the sensor.
        spurious_share: share of beams that fitted dependences let return from elsewhere.
        spurious: (n,) their density [1/m] at the measured range, times the share.
    """

    range_m: np.ndarray
    range_sigma_m: np.ndarray
    rise_m: np.ndarray
    intensity: np.ndarray
    intensity_sigma: np.ndarray
    seen: np.ndarray
    silent: np.ndarray
    stray: np.ndarray
    split: np.ndarray
    unsure_m: np.ndarray
    unsure_intensity: np.ndarray
    spurious_share: np.ndarray | float = 0.0
    spurious: np.ndarray | float = 0.0


@dataclass(frozen=True, eq=False)
class Sample:
    """n beams of some frames.

    Attributes:
        replay: of the beams.
        frame: (n,) int row of `names`.
        beam: (n,) int row of the frame's beams.
        names: of the frames, in order of time.
        weight: (n,) how many beams each stands for.
        along_m, above_m, intensity: (n,) measured, as in `Observed`; NaN where nothing returned.
        track: (n,) int what beams share errors with over time: an instance, or a cell of the map.
        track_names: (tracks,) str of each: an object's id, a cell of the plan, a sector of the sky.
        cells: (tracks, 3) number of the world and middle [m] of each cell of a map; NaN of other tracks.
        pose_derivative: (n, 6) change of range per metre and radian of the LiDAR's pose, in its own axes.
        unsure_m, unsure_intensity: (n,) how far the twin itself may be off, see `TracedFrame`.
        object_derivative: (n, 4) change of range by a shift of the object that is met, in world axes [m/m], and by its
            turn about the vertical through its origin [m/rad]; 0 elsewhere.
        object_scan: (n,) int number of the object in this scan; −1 elsewhere.
        facing: (n,) int which of six directions the surface's normal is nearest to; the surface's row in a map that
            was made of the scans.
        surface: (n,) int number of the cell of the static world: a square of the ground plan and a direction of its
            normal; −1 elsewhere.
        surface_derivative: (n,) change of range by a shift of that cell along its normal [m/m]; 0 elsewhere.
        own: (n,) int row of the same beam: its own but for rows that are about what a beam meets if it stands beyond an
            edge, which measured nothing of themselves.
        first: (n,) bool: one row of each beam, its own.
        chance: (n,) that the beam meets what its row is about; of the rows of a beam they are 1 together.
        edge: (n,) bool: near an edge, so that the beam may meet neither.
        border: (n,) bool beams of ambiguous brightness.
        seam: (n,) bool the same, where the brightness itself tells whose it is.
        compared: (n,) bool: beams that can be compared with the twin; of others it only tells something where their
            returns stand above them.
        partner: (n,) int row of the beam fired just before or after at the same surface, −1 where there is none:
            their difference knows nothing of errors that both share.
        ring, firing, block, material, instance: (n,) int.
        elevation_deg: (n,) nominal.
        kind, model: (n,) int rows of `kinds` and `models`, what is met; 0 for the static world and nothing.
        kinds, models: names.
        reflectance: (n,) of the surface.
        beside: by name, (n,) what beams beside each measured: `previous` of its ring, `above` and `below` it; ranges
            [m] and intensities are 0 where nothing returned, `lost` is 1 where a surface should have been seen.
        own_axes: whether scans stand where their twins were made, so that poses have no errors.
        of_own_map: whether the twin is a map made of the scans: places of surfaces and scans are free.
        scan_values: by name, (scans,) pose time, and the ego vehicle's speed, acceleration and yaw rate.
        azimuth, time_s, range_m, cos_incidence: (n,) of the beams as traced.
        settings: those that frames were traced with.
    """

    replay: Replay
    frame: np.ndarray
    beam: np.ndarray
    names: tuple[str, ...]
    weight: np.ndarray
    along_m: np.ndarray
    above_m: np.ndarray
    intensity: np.ndarray
    track: np.ndarray
    track_names: np.ndarray
    facing: np.ndarray
    cells: np.ndarray
    pose_derivative: np.ndarray
    unsure_m: np.ndarray
    unsure_intensity: np.ndarray
    object_derivative: np.ndarray
    object_scan: np.ndarray
    surface: np.ndarray
    surface_derivative: np.ndarray
    own: np.ndarray
    first: np.ndarray
    chance: np.ndarray
    edge: np.ndarray
    border: np.ndarray
    seam: np.ndarray
    compared: np.ndarray
    partner: np.ndarray
    ring: np.ndarray
    firing: np.ndarray
    block: np.ndarray
    elevation_deg: np.ndarray
    kind: np.ndarray
    model: np.ndarray
    kinds: tuple[str, ...]
    models: tuple[str, ...]
    azimuth: np.ndarray
    time_s: np.ndarray
    range_m: np.ndarray
    cos_incidence: np.ndarray
    material: np.ndarray
    instance: np.ndarray
    place: np.ndarray
    reflectance: np.ndarray
    beside: dict[str, np.ndarray]
    own_axes: bool
    of_own_map: bool
    scan_values: dict[str, np.ndarray]
    settings: Settings

    def __len__(self) -> int:
        return len(self.frame)

    @cached_property
    def share(self) -> np.ndarray:
        """(n,) weights that are 1 on average."""
        return self.weight / self.mean_weight

    @cached_property
    def clear(self) -> np.ndarray:
        """(n,) bool: beams that tell of returns from nowhere."""
        return self.compared & ~self.edge

    @cached_property
    def mean_weight(self) -> float:
        """How many beams a beam stands for on average."""
        return float(self.weight[self.first].mean())

    @cached_property
    def returned(self) -> np.ndarray:
        """(n,) bool."""
        return ~np.isnan(self.along_m)

    @cached_property
    def has_intensity(self) -> bool:
        """Whether the drive has intensities at all."""
        return bool(np.nanmax(np.append(self.intensity, 0.0)) > 0)

    @cached_property
    def intensity_limits(self) -> tuple[float, float]:
        """Values at or beyond which intensities have been cut off.

        Stored in steps, whatever is more than half a step above the last value but one has become the last.
        """
        told = self.intensity[~np.isnan(self.intensity)]
        inside = told[(told > 0) & (told < 1)]
        low = float(inside.min()) / 2 if len(inside) and (told <= 0).any() else 0.0
        high = (1 + float(inside.max())) / 2 if len(inside) and (told >= 1).any() else 1.0
        return low, high

    def reported_range(self, effects: Sequence[Effect]) -> np.ndarray:
        """(n,) measured ranges from where effects have the optical centre stand [m]; NaN where nothing returned."""
        found = [replay.ranges(effects, self.along_m[rows], self.above_m[rows]) for replay, rows in self._frames()]
        return np.concatenate(found)

    def moved(self, effects: Sequence[Effect]) -> tuple[float, float]:
        """How far effects turn [rad] and shift [m] beams from where they were traced: nearly all that returned."""
        used = self.compared & self.returned
        found = [replay.moved(effects, used[rows]) for replay, rows in self._frames()]
        return max(turn for turn, _ in found), max(shift for _, shift in found)

    def predict(self, effects: Sequence[Effect]) -> Prediction:
        """What effects let expect of the sample's beams."""
        effects = tuple(sorted(effects, key=lambda effect: effect.phase))
        return self._prediction(self.replay.expect(effects))

    def predict_traced(self, effects: Sequence[Effect], shot: Shot, found: Expectation) -> Prediction:
        """The same of a sample that holds all beams of one frame, from what is expected of the frame's own shot.

        Args:
            effects: of the model.
            shot: of the frame, traced as the effects bend its beams.
            found: expectation of that shot.
        """
        effects = tuple(sorted(effects, key=lambda effect: effect.phase))
        return self._prediction(self.replay.frames[0].completed(effects, shot, found))

    def _prediction(self, found: Expected) -> Prediction:
        return Prediction(
            range_m=found.of.range_m + found.along_m,
            range_sigma_m=found.of.range_sigma_m,
            rise_m=found.above_m,
            intensity=found.of.intensity,
            intensity_sigma=found.of.intensity_sigma,
            seen=found.of.seen,
            silent=found.of.silent,
            stray=found.stray,
            split=found.split,
            unsure_m=self.unsure_m,
            unsure_intensity=self.unsure_intensity,
        )

    def clear_of(self, ambiguous: Sequence[np.ndarray]) -> Sample:
        """The same without beams that are ambiguous: (n,) bool of every frame's beams."""
        off = np.zeros(len(self), bool)
        for number, mask in enumerate(ambiguous):
            mine = self.frame == number
            off[mine] = mask[self.beam[mine]]
        partner = np.where(off | off[np.maximum(self.partner, 0)], -1, self.partner)
        return replace(self, compared=self.compared & ~off, partner=partner)

    def _frames(self) -> Iterator[tuple[FrameReplay, np.ndarray]]:
        for number, replay in enumerate(self.replay.frames):
            yield replay, self.frame == number
