"""Points measured by a sensor with known effects are brought to where a sensor without them would have them."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.recordings import Scan
from cosim.recordings.mapping.correction import Correction, moves_points
from sensors.beams import Beams
from sensors.effects.acting import Streams, act_on_beams
from sensors.effects.base import BeamEffect, Effect
from sensors.effects.beams.dual_block import DualBlock
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.beams.encoder_eccentricity import EncoderEccentricity
from sensors.effects.beams.ring_elevation import RingElevation
from sensors.effects.points.range_bias import RangeBias
from sensors.effects.points.range_walk import RangeWalk
from sensors.pattern import load_pattern
from sensors.shot import Shot

PATTERN = load_pattern("vlp16")
LINES = np.column_stack([np.radians(PATTERN.elevation_deg), np.zeros(PATTERN.rings)])


def measured(effects: tuple[Effect, ...]) -> tuple[Scan, np.ndarray]:
    """A scan as a sensor with these effects stores it, and where its points truly were (n, 3)."""
    rng, rays = np.random.default_rng(0), PATTERN.rays()
    rows = rng.choice(len(rays), 500, replace=False)
    light = rng.uniform(0.05, 0.9, len(rays)).astype(np.float32)
    beams = act_on_beams(
        [one for one in effects if isinstance(one, BeamEffect)],
        Beams.nominal(rays), Shot(PATTERN, rays), Streams(np.random.default_rng(0)), "test",
    )  # fmt: skip
    reach = rng.uniform(4, 40, len(rays))
    true = beams.origin + reach[:, None] * beams.direction
    report = reach.copy()
    for one in effects:
        if isinstance(one, RangeWalk):
            report += one.amplitude_m * np.exp(-one.decay * light)
        if isinstance(one, RangeBias):
            report += one.offset_m
    stored = beams.rays.origin + report[:, None] * beams.rays.direction
    return Scan("000000", stored[rows].astype(np.float64), light[rows]), true[rows].astype(np.float64)


@pytest.mark.parametrize(
    "effects",
    [
        (ElevationOffset(offset_deg=0.2),),
        (EncoderEccentricity(amplitude_deg=0.3, phase_deg=40.0),),
        (RingElevation(offsets_deg=tuple(np.linspace(-0.1, 0.1, 16))),),
        (RangeBias(offset_m=0.06),),
        (RangeWalk(amplitude_m=0.15, decay=4.0),),
        (ElevationOffset(offset_deg=-0.3), RangeWalk(amplitude_m=0.1, decay=2.0), RangeBias(offset_m=-0.03)),
    ],
    ids=lambda effects: "+".join(one.name for one in effects),
)
def test_points_return_to_where_they_were(effects: tuple[Effect, ...]) -> None:
    scan, true = measured(effects)
    correction = Correction(PATTERN, LINES, np.arange(PATTERN.rings), effects)
    assert np.abs(scan.xyz - true).max() > 0.02
    np.testing.assert_allclose(correction.undone(scan).xyz, true, atol=2e-4)


def test_points_on_no_beam_stay() -> None:
    scan, _ = measured(())
    stray = Scan("000000", np.vstack([scan.xyz, [[3.0, 1.0, 9.0]]]), np.append(scan.intensity, np.float32(0.5)))  # type: ignore[arg-type]
    correction = Correction(PATTERN, LINES, np.arange(PATTERN.rings), (ElevationOffset(offset_deg=0.5),))
    np.testing.assert_array_equal(correction.undone(stray).xyz[-1], stray.xyz[-1])


def test_effects_that_do_not_move_points_need_no_new_map() -> None:
    for name in ("elevation_offset", "range_walk", "sweep_motion", "ring_elevation"):
        assert moves_points(name)
    for name in ("range_noise", "incidence_falloff", "random_dropout", "dual_block"):
        assert not moves_points(name)
    known = (DualBlock(upper_m=0.1, lower_m=-0.1),)
    assert not Correction(PATTERN, LINES, np.arange(PATTERN.rings), known).is_needed
