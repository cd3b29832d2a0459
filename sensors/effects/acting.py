"""Apply effects one after another, and check the results of user-defined ones."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import fields, replace

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import (
    BeamEffect,
    DetectionEffect,
    EchoEffect,
    Effect,
    LabelEffect,
    NoiseEffect,
    NoiseScaleEffect,
    PointEffect,
    ScanEffect,
)
from sensors.effects.blame import blamed, broken, check_values, is_finite
from sensors.effects.phases import CLIP_BEFORE
from sensors.label_boxes import LabelBoxes
from sensors.returns import Returns
from sensors.shot import Shot


def in_order(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects in the order in which they act."""
    return tuple(sorted(effects, key=lambda effect: effect.phase))


def bending(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects that deflect beams, for which frames must be traced again."""
    return tuple(effect for effect in effects if isinstance(effect, BeamEffect))


class Streams:
    """Random number streams, one per effect, so that an added effect does not change the draws of the others."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._root = int(rng.integers(2**63))
        self._met: Counter[str] = Counter()

    def of(self, effect: Effect) -> np.random.Generator:
        """The next stream of this effect."""
        number = self._met[effect.name]
        self._met[effect.name] += 1
        return np.random.default_rng([self._root, zlib.crc32(effect.name.encode()), number])


def act_on_beams(
    effects: Sequence[Effect],
    beams: Beams,
    shot: Shot,
    streams: Streams,
    origin: str,
    trace: Callable[[Beams], Shot] | None = None,
) -> Beams:
    """Return the beams after all beam effects.

    Args:
        effects: of the sensor.
        beams: before them.
        shot: of these beams, untraced.
        streams: of random numbers.
        origin: of the sensor, for messages.
        trace: gives the shot in which beams meet surfaces, for effects with `needs_surfaces`; by default beams are
            traced in the world of `shot`.
    """
    for effect in effects:
        if isinstance(effect, BeamEffect):
            seen = (trace or _tracing(shot))(beams) if effect.needs_surfaces else shot
            changed = _called(effect, beams, seen, streams.of(effect), origin)
            if effect.source:
                _check_beams(effect, beams, changed, origin)
            beams = changed
    return beams


def _tracing(shot: Shot) -> Callable[[Beams], Shot]:
    """Trace beams in the world of a shot."""

    def trace(beams: Beams) -> Shot:
        if shot.world is None:
            return shot
        return Shot(
            shot.pattern,
            beams.rays,
            beams=beams,
            traced=shot.world.trace(beams, "beams before an effect"),
            world=shot.world,
            frame_time_s=shot.frame_time_s,
        )

    return trace


def act_on_returns(
    effects: Sequence[Effect],
    returns: Returns,
    shot: Shot,
    streams: Streams,
    origin: str,
    memo: dict[tuple[str, ...], Returns] | None = None,
) -> Returns:
    """The returns after all echo, point and scan effects; finite, in front of the sensor, intensity in 0–1.

    `memo` caches the returns after each prefix of the list of effects, for other lists on the same shot and streams.
    """
    clips, past, noise = list(CLIP_BEFORE), tuple[str, ...](), Noise(len(shot.rays))
    shot.noiseless = None
    for effect in effects:
        if not isinstance(effect, EchoEffect | PointEffect | ScanEffect):
            continue
        while clips and effect.phase >= clips[0]:
            clips.pop(0)
            returns = _clipped(returns)
        if shot.noiseless is None and isinstance(effect, NoiseEffect | NoiseScaleEffect | ScanEffect):
            shot.noiseless = returns
        rng, before = streams.of(effect), returns
        past = (*past, f"{effect.source or effect.name} {effect.model_dump_json()}")
        if memo is not None and past in memo:
            returns = memo[past]
        else:
            if effect.source and isinstance(effect, DetectionEffect):
                with blamed(effect, origin):
                    kept = effect.kept(before, shot)
                check_values(effect, "kept", kept, len(before), 0.0)
            returns = _called(effect, before, shot, rng, origin)
            if isinstance(effect, NoiseScaleEffect):
                with blamed(effect, origin):
                    returns = noise.scaled(effect, before, shot)
            if effect.source:
                check_returns(effect, before, returns, shot, origin)
            if memo is not None:
                memo[past] = returns
        if isinstance(effect, NoiseEffect | NoiseScaleEffect):
            noise.add(before, returns)
    returns = _clipped(returns)
    usable = np.isfinite(returns.range_m) & (returns.range_m > 0) & np.isfinite(returns.intensity)
    return returns if usable.all() else returns.take(usable)


def act_on_boxes(effects: Sequence[Effect], boxes: LabelBoxes, streams: Streams, origin: str) -> LabelBoxes:
    """Return the labelled boxes after all label effects."""
    for effect in effects:
        if not isinstance(effect, LabelEffect):
            continue
        with blamed(effect, origin):
            changed = effect.apply(boxes, streams.of(effect))
        if effect.source:
            _check_boxes(effect, boxes, changed, origin)
        boxes = changed
    return boxes


class Noise:
    """The noise that effects have added to the returns of a revolution, by return number and beam.

    Args:
        beams: their number.
    """

    def __init__(self, beams: int) -> None:
        self._range_m, self._intensity = np.zeros((2, beams), np.float32), np.zeros((2, beams), np.float32)

    def add(self, before: Returns, after: Returns) -> None:
        """Add the change that an effect made to the same returns."""
        at = np.minimum(before.return_no, 1), before.beam
        self._range_m[at] += after.range_m - before.range_m
        self._intensity[at] += after.intensity - before.intensity

    def scaled(self, effect: NoiseScaleEffect, returns: Returns, shot: Shot) -> Returns:
        """Return the returns with their noise multiplied by the factors of an effect."""
        at = np.minimum(returns.return_no, 1), returns.beam
        range_m, intensity = returns.range_m - self._range_m[at], returns.intensity - self._intensity[at]
        of_range, of_intensity = effect.factors(replace(returns, range_m=range_m, intensity=intensity), shot)
        return replace(
            returns,
            range_m=(returns.range_m + (of_range - 1) * self._range_m[at]).astype(np.float32),
            intensity=(returns.intensity + (of_intensity - 1) * self._intensity[at]).astype(np.float32),
        )


def _clipped(returns: Returns) -> Returns:
    return replace(returns, intensity=returns.intensity.clip(0, 1))


def _called(effect, state, shot: Shot, rng: np.random.Generator, origin: str):
    with blamed(effect, origin):
        return effect.apply(state, shot, rng)


def _check_beams(effect: Effect, before: Beams, after: object, origin: str) -> None:
    if not isinstance(after, Beams):
        raise broken(effect, origin, f"returned {type(after).__name__}; return Beams")
    shape = (len(before.rays), 3)
    for name in ("origin", "direction"):
        values = getattr(after, name)
        if np.shape(values) != shape or not is_finite(values):
            raise broken(effect, origin, f"gave {name} of shape {np.shape(values)} or not finite; give {shape}")


def check_returns(effect: Effect, before: Returns, after: object, shot: Shot, origin: str) -> None:
    """Check the returns that a user's effect gave.

    Raises:
        SensorError: not `Returns`, wrong shapes or types, NaN, or unsorted beams.
    """
    if not isinstance(after, Returns):
        raise broken(effect, origin, f"returned {type(after).__name__}; return Returns")
    rows = len(after.beam)
    if isinstance(effect, PointEffect) and rows != len(before):
        raise broken(effect, origin, f"returned {rows} of {len(before)} returns; a PointEffect keeps them all")
    for field in fields(Returns):
        values = getattr(after, field.name)
        wanted = (rows, 2) if field.name == "normal_code" else (rows,)
        if np.shape(values) != wanted:
            raise broken(effect, origin, f"gave {field.name} of shape {np.shape(values)}; give {wanted}")
        kind, usual = np.asarray(values).dtype, getattr(before, field.name).dtype
        if kind.kind not in ("f" if usual.kind == "f" else "iu"):
            raise broken(effect, origin, f"gave {field.name} of type {kind}; give {usual}")
    if not (np.isfinite(after.range_m).all() and np.isfinite(after.intensity).all()):
        raise broken(effect, origin, "gave NaN or infinity; keep range_m and intensity finite")
    if rows and (after.beam.min() < 0 or after.beam.max() >= len(shot.rays) or (np.diff(after.beam) < 0).any()):
        raise broken(effect, origin, "gave beams out of order or bounds; sort rows by beam")


def _check_boxes(effect: Effect, before: LabelBoxes, after: object, origin: str) -> None:
    if not isinstance(after, LabelBoxes):
        raise broken(effect, origin, f"returned {type(after).__name__}; return LabelBoxes")
    for name in ("centre", "size", "yaw", "kept"):
        values, wanted = getattr(after, name), np.shape(getattr(before, name))
        if np.shape(values) != wanted or not is_finite(values):
            raise broken(effect, origin, f"gave {name} of shape {np.shape(values)} or not finite; give {wanted}")
    if (after.size <= 0).any():
        raise broken(effect, origin, "gave a size that is not above zero; keep every edge positive")
