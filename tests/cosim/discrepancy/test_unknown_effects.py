"""Effects of unknown dependences: the contract over all channels and kinds of covariates."""

from __future__ import annotations

from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.unknown.curve import CHANNEL_UNITS, Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.unknown.effect_class import effect_class, effect_of
from cosim.discrepancy.unknown.source import effect_source
from sensors.effects.base import Effect
from sensors.effects.registry import find_effect
from sensors.effects.shared_errors import UNITS
from sensors.returns import Returns
from tests.cosim.discrepancy.unknown_curves import (
    COVARIATES,
    PAIRS,
    SHARED,
    SIZES,
    curve_of,
    expected,
    measured,
    shared_curve,
)

CURVES = [
    *(curve_of(channel, name) for channel in SIZES for name in COVARIATES),
    *(curve_of(channel, *pair) for channel in SIZES for pair in PAIRS),
    *(shared_curve(channel, unit) for channel in SHARED for unit in UNITS),
]


def named(curve: Curve) -> str:
    return curve.name


def from_file(curve: Curve, folder: Path) -> Effect:
    """The effect of the written file."""
    unknown = UnknownEffect.of(curve)
    (folder / f"{unknown.name}.py").write_text(effect_source(unknown), encoding="utf-8")
    kind = find_effect(f"{unknown.name}.py:{unknown.class_name}", folder)
    return kind.model_validate(kind.example)


def same(first: Returns, second: Returns) -> bool:
    return all(getattr(first, one.name).tobytes() == getattr(second, one.name).tobytes() for one in fields(Returns))


@cache
def without() -> Returns:
    return measured(())[0]


@pytest.mark.parametrize("curve", CURVES, ids=named)
def test_the_written_file_and_the_class_in_memory_do_the_same(curve: Curve, tmp_path: Path) -> None:
    written, made = from_file(curve, tmp_path), effect_of(curve)
    assert written.model_dump() == made.model_dump()
    for name in ("name", "channel", "stage", "phase", "example", "neutral", "shapes", "equation", "needs_new_rays"):
        assert getattr(written, name) == getattr(made, name)
    assert same(measured((written,))[0], measured((made,))[0])
    first, second = expected((written,))[0], expected((made,))[0]
    for one in ("range_m", "range_sigma_m", "intensity", "intensity_sigma", "seen", "silent"):
        np.testing.assert_array_equal(getattr(first, one), getattr(second, one))
