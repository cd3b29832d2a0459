"""Lets effects act one after the other, and holds users' own ones to the rules."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace

import numpy as np

from sensors.beams import Beams
from sensors.effects.base import BeamEffect, EchoEffect, Effect, LabelEffect, PointEffect, ScanEffect
from sensors.effects.phases import CLIP_BEFORE
from sensors.errors import SensorError
from sensors.label_boxes import LabelBoxes
from sensors.returns import Returns
from sensors.shot import Shot


def in_order(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects in the order in which they act."""
    return tuple(sorted(effects, key=lambda effect: effect.phase))


def bending(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Those that bend beams, for which frames must be traced anew."""
    return tuple(effect for effect in effects if isinstance(effect, BeamEffect))


class Streams:
    """One stream of random numbers an effect, so that adding one leaves the draws of the others as they were."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._root = int(rng.integers(2**63))
        self._met: Counter[str] = Counter()

    def of(self, effect: Effect) -> np.random.Generator:
        """The next stream of this effect."""
        number = self._met[effect.name]
        self._met[effect.name] += 1
        return np.random.default_rng([self._root, zlib.crc32(effect.name.encode()), number])


def act_on_beams(effects: Sequence[Effect], beams: Beams, shot: Shot, streams: Streams, origin: str) -> Beams:
    """The beams after all beam effects."""
    for effect in effects:
        if isinstance(effect, BeamEffect):
            changed = _called(effect, beams, shot, streams.of(effect), origin)
            if effect.source:
                _check_beams(effect, beams, changed, origin)
            beams = changed
    return beams


def act_on_returns(
    effects: Sequence[Effect],
    returns: Returns,
    shot: Shot,
    streams: Streams,
    origin: str,
    memo: dict[tuple[str, ...], Returns] | None = None,
) -> Returns:
    """The returns after all echo, point and scan effects; finite, in front of the sensor, intensity in 0–1.

    `memo` keeps what each beginning of a list of effects led to, for other lists on the same shot and streams.
    """
    clips, past = list(CLIP_BEFORE), tuple[str, ...]()
    for effect in effects:
        if not isinstance(effect, EchoEffect | PointEffect | ScanEffect):
            continue
        while clips and effect.phase >= clips[0]:
            clips.pop(0)
            returns = _clipped(returns)
        rng = streams.of(effect)
        past = (*past, f"{effect.source or effect.name} {effect.model_dump_json()}")
        if memo is not None and past in memo:
            returns = memo[past]
            continue
        changed = _called(effect, returns, shot, rng, origin)
        if effect.source:
            _check_returns(effect, returns, changed, shot, origin)
        returns = changed
        if memo is not None:
            memo[past] = returns
    returns = _clipped(returns)
    usable = np.isfinite(returns.range_m) & (returns.range_m > 0) & np.isfinite(returns.intensity)
    return returns if usable.all() else returns.take(usable)


def act_on_boxes(effects: Sequence[Effect], boxes: LabelBoxes, streams: Streams, origin: str) -> LabelBoxes:
    """The labelled boxes after all label effects."""
    for effect in effects:
        if not isinstance(effect, LabelEffect):
            continue
        with _blamed(effect, origin):
            changed = effect.apply(boxes, streams.of(effect))
        if effect.source:
            _check_boxes(effect, boxes, changed, origin)
        boxes = changed
    return boxes


def _clipped(returns: Returns) -> Returns:
    return replace(returns, intensity=returns.intensity.clip(0, 1))


def _called(effect, state, shot: Shot, rng: np.random.Generator, origin: str):
    with _blamed(effect, origin):
        return effect.apply(state, shot, rng)


@contextmanager
def _blamed(effect: Effect, origin: str) -> Iterator[None]:
    """Errors of a user's effect in one line that names it; those of built-in ones as they are."""
    try:
        yield
    except Exception as error:
        if not effect.source:
            raise
        told = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise _broken(effect, origin, f"raised {told}; mend its apply") from error


def _check_beams(effect: Effect, before: Beams, after: object, origin: str) -> None:
    if not isinstance(after, Beams):
        raise _broken(effect, origin, f"returned {type(after).__name__}; return Beams")
    shape = (len(before.rays), 3)
    for name in ("origin", "direction"):
        values = getattr(after, name)
        if np.shape(values) != shape or not _finite(values):
            raise _broken(effect, origin, f"gave {name} of shape {np.shape(values)} or not finite; give {shape}")


def _check_returns(effect: Effect, before: Returns, after: object, shot: Shot, origin: str) -> None:
    if not isinstance(after, Returns):
        raise _broken(effect, origin, f"returned {type(after).__name__}; return Returns")
    rows = len(after.beam)
    if isinstance(effect, PointEffect) and rows != len(before):
        raise _broken(effect, origin, f"returned {rows} of {len(before)} returns; a PointEffect keeps them all")
    for field in fields(Returns):
        values = getattr(after, field.name)
        wanted = (rows, 2) if field.name == "normal_code" else (rows,)
        if np.shape(values) != wanted:
            raise _broken(effect, origin, f"gave {field.name} of shape {np.shape(values)}; give {wanted}")
        kind, usual = np.asarray(values).dtype, getattr(before, field.name).dtype
        if kind.kind not in ("f" if usual.kind == "f" else "iu"):
            raise _broken(effect, origin, f"gave {field.name} of type {kind}; give {usual}")
    if not (np.isfinite(after.range_m).all() and np.isfinite(after.intensity).all()):
        raise _broken(effect, origin, "gave NaN or infinity; keep range_m and intensity finite")
    if rows and (after.beam.min() < 0 or after.beam.max() >= len(shot.rays) or (np.diff(after.beam) < 0).any()):
        raise _broken(effect, origin, "gave beams out of order or bounds; sort rows by beam")


def _check_boxes(effect: Effect, before: LabelBoxes, after: object, origin: str) -> None:
    if not isinstance(after, LabelBoxes):
        raise _broken(effect, origin, f"returned {type(after).__name__}; return LabelBoxes")
    for name in ("centre", "size", "yaw", "kept"):
        values, wanted = getattr(after, name), np.shape(getattr(before, name))
        if np.shape(values) != wanted or not _finite(values):
            raise _broken(effect, origin, f"gave {name} of shape {np.shape(values)} or not finite; give {wanted}")
    if (after.size <= 0).any():
        raise _broken(effect, origin, "gave a size that is not above zero; keep every edge positive")


def _finite(values: object) -> bool:
    array = np.asarray(values)
    return array.dtype.kind in "biuf" and bool(np.isfinite(array).all())


def _broken(effect: Effect, origin: str, what: str) -> SensorError:
    return SensorError(f"sensor {origin}: effect {effect.name} ({effect.source}) {what}")
