"""Sample of beams of a drive: measurements, derivatives and groups (scan, object, map cell) of each beam."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cosim.discrepancy.forward.joined import SampleReplay
from cosim.discrepancy.forward.replay import Expected, FrameReplay
from cosim.discrepancy.settings import Settings
from sensors.effects.base import Effect
from sensors.effects.expectation import Expectation
from sensors.shot import Shot


@dataclass(frozen=True, eq=False)
class Prediction:
    """Prediction of a model for the n beams of a sample; arrays (n,).

    Attributes:
        range_m, range_sigma_m: mean and σ [m] of the measured point's component along the beam; NaN if no surface is
            hit.
        rise_m: mean [m] of its component perpendicular to the beam, upwards.
        intensity, intensity_sigma: mean and σ of the intensity (0 to 1).
        seen: probability that the return of the surface is reported.
        silent: probability that no return is reported.
        spurious_per_m: probability density [1/m] of spurious returns at the measured range; 0 without a return.
        twin_sigma_m, twin_sigma_intensity: σ of the twin itself, in addition to that of the sensor.
        twin_unshared_m: the part of `twin_sigma_m` that neighbouring beams do not have in common.
        spurious_share: share of beams with spurious returns according to fitted dependences.
        spurious: their density [1/m] at the measured range, times the share.
        log_odds_by_reflectance: computes the derivative (n,) of the log-odds of `seen` with respect to the relative
            reflectance of the surface.
    """

    range_m: np.ndarray
    range_sigma_m: np.ndarray
    rise_m: np.ndarray
    intensity: np.ndarray
    intensity_sigma: np.ndarray
    seen: np.ndarray
    silent: np.ndarray
    spurious_per_m: np.ndarray
    twin_sigma_m: np.ndarray
    twin_sigma_intensity: np.ndarray
    twin_unshared_m: np.ndarray
    log_odds_by_reflectance: Callable[[], np.ndarray]
    spurious_share: np.ndarray | float = 0.0
    spurious: np.ndarray | float = 0.0


@dataclass(frozen=True, eq=False)
class Sample:
    """n beams of some frames.

    Attributes:
        replay: replays effects on the sampled beams.
        frame: (n,) int index into `names`.
        beam: (n,) int row among all beams of the frame.
        names: names of the frames, in order of time.
        weight: (n,) number of beams that each represents (inverse of its sampling probability).
        along_m, above_m, intensity: (n,) measurements as in `Observed`; NaN without a return.
        track: (n,) int number of the object or map cell; beams of a track share errors over time.
        track_names: (tracks,) str object id, map cell, or sector of the sky.
        cells: (tracks, 3) world number and centre x, y [m] of each map cell; NaN for other tracks.
        pose_derivative: (n, 6) derivative of the range with respect to the LiDAR's pose: shifts [m/m] and rotations
            [m/rad] in LiDAR axes.
        twin_sigma_m, twin_sigma_intensity: (n,) σ of the twin itself, see `TracedFrame`.
        object_derivative: (n, 4) derivative of the range with respect to a shift of the object that is hit, in world
            axes [m/m], and to its rotation about the vertical through its origin [m/rad]; 0 for other beams.
        object_scan: (n,) int number of the pair of object and scan; −1 for other beams.
        facing: (n,) int nearest of six axis directions to the surface normal; for a map made from the scans the row of
            the surface.
        surface: (n,) int number of the cell of the static world (square of the ground plan and direction of the
            normal); −1 for other beams.
        surface_derivative: (n,) derivative of the range with respect to a shift of this cell along its normal [m/m]; 0
            for other beams.
        own: (n,) int row with the beam's measurement. Near edges a beam has further rows for the surfaces beyond the
            edge, which point to its first row; elsewhere each row points to itself.
        first: (n,) bool whether this is the first row of the beam.
        chance: (n,) probability that the beam hits the surface of this row; sums to 1 over the rows of a beam.
        edge: (n,) bool near an edge, so that the beam may also hit none of the surfaces.
        surface_nearby: (n,) bool near an edge, with a return from the range of a surface that nearby beams hit.
        border: (n,) bool the beam may hit another material, so that its intensity is ambiguous.
        seam: (n,) bool the same, but the measured intensity itself can decide.
        compared: (n,) bool beams that can be compared with the twin; of other beams only `above_m` is used.
        at_end: (n,) bool beams near the end of a map made from the scans, beyond which they hit nothing.
        unmapped: (n,) share of the beams towards such a map there that something stops that is not in the map.
        partner: (n,) int row of the beam fired directly before or after that hits the same surface, −1 for none; common
            errors cancel in the difference.
        ring, firing, block, material, instance: (n,) int.
        elevation_deg: (n,) nominal elevation.
        kind, model: (n,) int index of the object that is hit in `kinds` and `models`; 0 for static surfaces and misses.
        kinds, models: names of object classes and models.
        place: (n, 3) point of the surface that is hit, world frame [m].
        reflectance: (n,) reflectance of the surface.
        neighbour_values: (n,) measurements of neighbouring beams by name: `previous` in the same ring, `above` and
            `below`; range [m] and intensity are 0 without a return, `lost` is 1 if a visible surface gave no return.
        own_axes: whether each twin was made in the frame of its scan, so that poses have no errors.
        of_own_map: whether the twin is a map made from the scans; surfaces and scans then have flat priors.
        scan_values: (scans,) by name: pose time [s] and the ego vehicle's speed, acceleration and yaw rate.
        azimuth, time_s, range_m, cos_incidence: (n,) azimuth [rad], time [s], range [m], cosine of the incidence angle
            of the traced beams.
        settings: settings that the frames were traced with.
    """

    replay: SampleReplay
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
    twin_sigma_m: np.ndarray
    twin_sigma_intensity: np.ndarray
    object_derivative: np.ndarray
    object_scan: np.ndarray
    surface: np.ndarray
    surface_derivative: np.ndarray
    own: np.ndarray
    first: np.ndarray
    chance: np.ndarray
    edge: np.ndarray
    surface_nearby: np.ndarray
    border: np.ndarray
    seam: np.ndarray
    compared: np.ndarray
    at_end: np.ndarray
    unmapped: np.ndarray
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
    neighbour_values: dict[str, np.ndarray]
    own_axes: bool
    of_own_map: bool
    scan_values: dict[str, np.ndarray]
    settings: Settings

    def __len__(self) -> int:
        return len(self.frame)

    @cached_property
    def share(self) -> np.ndarray:
        """(n,) weights with mean 1."""
        return self.weight / self.mean_weight

    @cached_property
    def clear(self) -> np.ndarray:
        """(n,) bool beams for which spurious returns can be recognised."""
        return self.compared & ~self.edge

    @cached_property
    def beside_sky(self) -> np.ndarray:
        """(n,) bool beams near edges that may hit nothing."""
        misses = ~np.isfinite(self.range_m) & (self.chance > 0)
        return self.edge & (np.bincount(self.own, misses, len(self))[self.own] > 0)

    @cached_property
    def edge_class(self) -> np.ndarray:
        """(n,) int class of beams near edges; −1 for others.

        Edges against the sky are classes of their own, because a beam that passes such an edge has no return either:
        how many are lost there says where the edge is. So are octaves of the distance: an error of an angle moves a
        distant edge further, so that more beams miss it.
        """
        first_m, last_m = self.settings.likelihood.edge_octaves_m
        distance_m = np.clip(self.sides_m[0], first_m, last_m * 0.99)
        octaves = int(np.log2(last_m / first_m))
        return np.where(self.edge, np.log2(distance_m / first_m).astype(int) + octaves * self.beside_sky, -1)

    @cached_property
    def sides_m(self) -> np.ndarray:
        """(2, n) ranges [m] of the nearest and the farthest surface that a beam may hit; infinite if there is none."""
        return self.sides_at(self.range_m)

    def sides_at(self, range_m: np.ndarray) -> np.ndarray:
        """The same for other ranges (n,) [m] of the surfaces of all rows; NaN or infinite for none."""
        nearest, farthest = np.full(len(self), np.inf), np.full(len(self), -np.inf)
        np.minimum.at(nearest, self.own, np.nan_to_num(range_m, nan=np.inf))
        np.maximum.at(farthest, self.own, np.where(np.isfinite(range_m), range_m, -np.inf))
        return np.stack([nearest, np.abs(farthest)])[:, self.own]

    @cached_property
    def is_before_sides(self) -> np.ndarray:
        """(n,) bool returns near edges from before all traced surfaces, see `outside_sides`."""
        return self.outside_sides(self.sides_m)[0]

    @cached_property
    def share_behind_sides(self) -> float:
        """Share of the beams near edges with a return from behind all traced surfaces, see `outside_sides`."""
        beams = self.weight * (self.compared & self.first & self.edge)
        return float(beams[self.outside_sides(self.sides_m)[1]].sum() / max(beams.sum(), 1.0))

    def outside_sides(self, sides_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns near edges from before all surfaces, and from behind all, where nearby beams hit none either.

        Args:
            sides_m: (2, n) ranges [m] of the nearest and the farthest surface of each beam.

        Returns:
            Two masks (n,) of first rows of beams.
        """
        possible = (
            self.compared & self.first & self.edge & self.returned & ~self.surface_nearby & np.isfinite(sides_m[0])
        )
        measured, apart = np.nan_to_num(self.along_m), self.settings.beams.same_m
        return possible & (measured < sides_m[0] - apart), possible & (measured > sides_m[1] + apart)

    @cached_property
    def unknown_surfaces(self) -> np.ndarray:
        """(c, n) likelihoods of beams that hit an unknown surface near an edge, in their first rows.

        Where the positions of edges are uncertain, most unknown surfaces are not far behind or in front of a side:
        leaves, or another part of the same object. How far they are is estimated with the shares: the distances from
        the traced sides have a mixture of Laplace distributions of fixed scales. The last two are a return at a uniform
        range, and none.
        """
        constants, distance_m = self.settings.likelihood, np.abs(self.along_m[self.own] - self.range_m)
        chance = np.where(np.isfinite(self.range_m), self.chance, 0.0)
        whole = np.bincount(self.own, chance, len(self))
        uniform = self.returned / constants.reach_m
        near = []
        for scale_m in constants.unknown_scales_m:
            density = chance * np.exp(-np.nan_to_num(distance_m) / scale_m) / (2 * scale_m)
            total = np.bincount(self.own, density, len(self))
            near.append(np.where(whole > 0, self.returned * total / np.maximum(whole, 1e-300), uniform))
        return np.stack([*near, uniform, (~self.returned).astype(float)])

    @cached_property
    def mean_weight(self) -> float:
        """Mean number of beams that a sampled beam represents."""
        return float(self.weight[self.first].mean())

    @cached_property
    def returned(self) -> np.ndarray:
        """(n,) bool whether the beam has a return."""
        return ~np.isnan(self.along_m)

    @cached_property
    def has_intensity(self) -> bool:
        """Whether the drive has intensities."""
        return bool(np.nanmax(np.append(self.intensity, 0.0)) > 0)

    @cached_property
    def intensity_limits(self) -> tuple[float, float]:
        """Lower and upper censoring limit of intensities.

        Stored intensities are rounded, so that the limits are half a step inside the extreme values.
        """
        measured = self.intensity[~np.isnan(self.intensity)]
        inside = measured[(measured > 0) & (measured < 1)]
        low = float(inside.min()) / 2 if len(inside) and (measured <= 0).any() else 0.0
        high = (1 + float(inside.max())) / 2 if len(inside) and (measured >= 1).any() else 1.0
        return low, high

    def reported_range(self, effects: Sequence[Effect]) -> np.ndarray:
        """(n,) measured ranges [m] from the optical centre that the effects imply; NaN without a return."""
        ranges = [replay.ranges(effects, self.along_m[rows], self.above_m[rows]) for replay, rows in self._frames()]
        return np.concatenate(ranges)

    def moved(self, effects: Sequence[Effect]) -> tuple[float, float]:
        """Rotation [rad] and shift [m] of beams by effects, relative to the traced beams (high quantile of returns)."""
        used = self.compared & self.returned
        moves = [replay.moved(effects, used[rows]) for replay, rows in self._frames()]
        return max(turn for turn, _ in moves), max(shift for _, shift in moves)

    def predict(self, effects: Sequence[Effect]) -> Prediction:
        """Predict the sample's beams from effects."""
        effects = tuple(sorted(effects, key=lambda effect: effect.phase))
        return self._prediction(self.replay.expect(effects))

    def predict_traced(self, effects: Sequence[Effect], shot: Shot, expectation: Expectation) -> Prediction:
        """Predict all beams of one frame from the expectation of its newly traced shot.

        Args:
            effects: effects of the model.
            shot: shot of the frame, traced with the beams as deflected by the effects.
            expectation: expectation of that shot.
        """
        effects = tuple(sorted(effects, key=lambda effect: effect.phase))
        return self._prediction(self.replay.frames[0].complete(effects, shot, expectation))

    def _prediction(self, expected: Expected) -> Prediction:
        return Prediction(
            range_m=expected.of.range_m + expected.along_m,
            range_sigma_m=expected.of.range_sigma_m,
            rise_m=expected.above_m,
            intensity=expected.of.intensity,
            intensity_sigma=expected.of.intensity_sigma,
            seen=expected.of.seen,
            silent=expected.of.silent,
            spurious_per_m=expected.spurious_per_m,
            twin_sigma_m=self.twin_sigma_m,
            twin_sigma_intensity=self.twin_sigma_intensity,
            twin_unshared_m=self.twin_sigma_m,
            log_odds_by_reflectance=expected.log_odds_by_reflectance,
        )

    def clear_of(self, ambiguous: Sequence[np.ndarray]) -> Sample:
        """Return the sample without ambiguous beams; `ambiguous` has a bool mask of all beams per frame."""
        is_excluded = np.zeros(len(self), bool)
        for number, mask in enumerate(ambiguous):
            rows = self.frame == number
            is_excluded[rows] = mask[self.beam[rows]]
        partner = np.where(is_excluded | is_excluded[np.maximum(self.partner, 0)], -1, self.partner)
        return replace(self, compared=self.compared & ~is_excluded, partner=partner)

    def _frames(self) -> Iterator[tuple[FrameReplay, np.ndarray]]:
        for number, replay in enumerate(self.replay.frames):
            yield replay, self.frame == number
