"""Unknown effects are in the data as their truths say, whatever is drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.hidden.columns import COLUMNS, firing, kind, made_of
from tests.hidden.drive import Hidden, reduced
from tests.hidden.head import nominal_beams
from tests.hidden.physics import Truth, measure, told
from tests.hidden.reading import LAWS
from tests.hidden.scan import Scan
from tests.hidden.twin_files import read_frames, read_pattern
from tests.hidden.twin_tracing import Twin
from tests.hidden.unknowns import KINDS, draw_two, noise_law

_SMALL = Hidden(firings=400, every_ring=2, noise=False)
_DRAWS = 30


class Bench:
    """One frame of the twin, traced once and measured often with a thin pattern."""

    def __init__(self, base: Path) -> None:
        self.twin, self.frame = Twin(base / "twin"), read_frames(base)[-1]
        self.beams = nominal_beams(reduced(read_pattern(base), _SMALL))
        self.bare = measure(Truth(), self.twin, self.frame, self.beams, np.random.default_rng(1), elapsed_s=6.0)

    def scan(
        self, elapsed_s: float = 6.0, effects: dict | None = None, unnamed: dict | None = None, **more: dict
    ) -> Scan:
        known, rng = (self.bare.solid, self.bare.pane), np.random.default_rng(1)
        truth = Truth(effects=effects or {}, unnamed=(unnamed or {}) | more)
        return measure(truth, self.twin, self.frame, self.beams, rng, elapsed_s, known)

    def moved_m(self, scan: Scan) -> np.ndarray:
        """(n,) change of range, not a number where either has no return."""
        both = scan.found & self.bare.found
        return np.where(both, scan.range_m - self.bare.range_m, np.nan)


@pytest.fixture(scope="module")
def bench(base: Path) -> Bench:
    return Bench(base)


@pytest.mark.parametrize("name", KINDS)
def test_a_kind_changes_the_channel_of_its_truth_and_no_other(bench: Bench, name: str) -> None:
    rng, bare, seen = np.random.default_rng(5), bench.bare, 0
    for draw in range(_DRAWS):
        parameters = KINDS[name].draw(rng, ("strong", "half")[draw % 2])
        scan = bench.scan(unnamed={name: parameters})
        both = scan.found & bare.found
        changed = {
            "range": bool((np.abs(scan.range_m - bare.range_m)[both] > 1e-6).any()),
            "intensity": bool((np.abs(scan.intensity - bare.intensity)[both] > 1e-6).any()),
            "drop": bool((scan.found != bare.found).any()),
        }
        channels = told(name, parameters).channels
        assert {channel for channel, is_so in changed.items() if is_so} <= set(channels), parameters
        seen += any(changed.values())
    assert seen >= 0.7 * _DRAWS or name == "noise_shape"  # a class may not be in sight; noise is off here


@pytest.mark.parametrize("name", KINDS)
def test_strengths_are_of_the_order_of_the_noise(bench: Bench, name: str) -> None:
    rng = np.random.default_rng(6)
    for level, low, high in (("strong", 1.5, 3.0), ("half", 0.4, 0.6)):
        for _ in range(_DRAWS):
            drawn = KINDS[name].draw(rng, level)
            size = abs(drawn["size"]) / (2 if name == "pair" else 1)
            if name == "noise_shape":
                assert 0.5 < drawn["share"] < 1
            elif drawn["channel"] == "drop":
                assert 0.04 <= size <= 0.35
            else:
                assert low <= size / {"range": 0.02, "intensity": 0.1}[drawn["channel"]] <= high


@pytest.mark.parametrize("covariate", COLUMNS)
def test_columns_span_what_beams_meet(bench: Bench, covariate: str) -> None:
    inside = COLUMNS[covariate].unit(bench.bare)[bench.bare.found]
    assert ((inside >= 0) & (inside <= 1)).mean() > 0.85
    assert np.ptp(inside) > 0.5


def test_a_pair_has_no_main_effect_of_the_azimuth(bench: Bench) -> None:
    pair = {"channel": "range", "size": 0.1, "first": "ring", "second": "azimuth", "waves": 1, "phase_deg": 0.0}
    moved, beams = bench.moved_m(bench.scan(pair=pair)), bench.beams
    left = beams.azimuth > 0
    above, below = beams.ring < beams.rings / 2, beams.ring >= beams.rings / 2
    assert np.nanmean(moved[left & above]) < -0.01 and np.nanmean(moved[left & below]) > 0.01
    assert np.nanmean(moved[~left & above]) > 0.01 and np.nanmean(moved[~left & below]) < -0.01
    everything = [abs(np.nanmean(moved[beams.ring == ring])) for ring in range(beams.rings // 2, beams.rings)]
    assert np.median(everything) < 0.2 * np.nanstd(moved)


def test_light_of_the_beam_above_moves_the_range(bench: Bench) -> None:
    scan = bench.scan(neighbours={"channel": "range", "size": 0.04, "look": "above_intensity"})
    moved = bench.moved_m(scan).reshape(bench.beams.rings, -1)
    light = np.where(bench.bare.found, bench.bare.intensity, 0).reshape(moved.shape)
    assert np.nanmax(np.abs(moved[0])) == pytest.approx(0, abs=1e-9)  # nothing is above the first ring
    np.testing.assert_allclose(
        moved[1:][~np.isnan(moved[1:])],
        (0.04 * np.minimum(light[:-1] / 0.5, 1.5))[~np.isnan(moved[1:])],
        atol=1e-9,
    )


def test_losses_follow_losses(bench: Bench) -> None:
    lossy = {"random_dropout": {"probability": 0.05}}
    scan = bench.scan(effects=lossy, neighbours={"channel": "drop", "size": 0.3, "look": "previous_lost"})
    plain = bench.scan(effects=lossy)
    grid = (bench.beams.rings, bench.beams.firings)
    found, before, bare = scan.found.reshape(grid), plain.found.reshape(grid), bench.bare.found.reshape(grid)
    after_loss = before[:, 1:] & ~before[:, :-1] & bare[:, :-1]
    after_return = before[:, 1:] & before[:, :-1]
    assert (~found[:, 1:])[after_loss].mean() == pytest.approx(0.3, abs=0.08)
    assert not (~found[:, 1:])[after_return].any()


@pytest.mark.parametrize("which", [{"objects": "cars"}, {"material": "asphalt"}])
def test_a_class_or_material_alone_is_biased(bench: Bench, which: dict) -> None:
    moved = bench.moved_m(bench.scan(class_or_material={"channel": "range", "size": 0.05, **which}))
    ours = kind(bench.bare) == "car" if "objects" in which else made_of(bench.bare, ("asphalt",))
    returned = ~np.isnan(moved)
    assert (ours & returned).sum() > 100
    np.testing.assert_allclose(moved[ours & returned], 0.05, atol=1e-9)  # no van or truck is in sight otherwise
    others = ~ours & returned & ~np.isin(kind(bench.bare), ("van", "truck", "bus"))
    np.testing.assert_allclose(moved[others], 0, atol=1e-9)


def test_periodic_losses_come_back_every_period(bench: Bench) -> None:
    losses = {"channel": "drop", "size": 1.0, "of": "firing", "period": 10.0, "duty": 0.25}
    scan = bench.scan(periodic=losses)
    lost = bench.bare.found & ~scan.found
    phase = np.mod(firing(scan), 10)
    assert set(phase[lost]) == {0, 1, 2}
    assert not scan.found[phase < 3].any()


def test_a_ripple_in_time_comes_back_after_its_period(bench: Bench) -> None:
    ripple = {"channel": "range", "size": 0.05, "of": "time", "period_s": 4.0, "phase_deg": 30.0}
    first, half, whole = (bench.moved_m(bench.scan(elapsed_s=time_s, periodic=ripple)) for time_s in (3.0, 5.0, 7.0))
    np.testing.assert_allclose(first, whole, atol=1e-9)
    np.testing.assert_allclose(first, -half, atol=1e-9)


def test_each_scan_has_a_level_of_its_own(bench: Bench) -> None:
    level = {"channel": "range", "size": 0.05, "seed": 9}
    moved = [bench.moved_m(bench.scan(elapsed_s=float(time_s), scan_level=level)) for time_s in range(200)]
    of_scan = np.array([np.nanmean(one) for one in moved])
    assert max(np.nanstd(one) for one in moved) < 1e-9
    assert np.std(of_scan) == pytest.approx(0.05, rel=0.15)
    assert abs(np.corrcoef(of_scan[1:], of_scan[:-1])[0, 1]) < 0.25  # nothing of the scan before


@pytest.mark.parametrize("law", ["two_humps", "skewed", "uniform"])
def test_shapes_of_noise_keep_its_variance(law: str) -> None:
    for share in (0.6, 0.9):
        shape = {"channel": "range", "law": law, "share": share, "mirrored": True, "size": 0.0}
        sample = noise_law(shape, LAWS["gaussian"])(np.random.default_rng(0), 400_000)
        assert np.std(sample) == pytest.approx(1, abs=0.01)
        assert np.mean(sample) == pytest.approx(0, abs=0.01)
        kurtosis, skewness = np.mean(sample**4) - 3, np.mean(sample**3)
        assert skewness < -0.5 if law == "skewed" else kurtosis < -0.3


def test_porous_surfaces_answer_from_behind(bench: Bench) -> None:
    moved = bench.moved_m(bench.scan(porous={"channel": "range", "size": 0.05, "materials": ["hedge", "grass"]}))
    leafy, returned = made_of(bench.bare, ("hedge", "grass")), ~np.isnan(moved)
    depth = moved[leafy & returned]
    assert (depth > 0).all()
    assert np.mean(depth) == pytest.approx(0.05, rel=0.1) and np.std(depth) == pytest.approx(0.05, rel=0.15)
    np.testing.assert_array_equal(moved[~leafy & returned], 0)


def test_two_at_once_act_in_different_channels() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        two = draw_two(rng, "strong")
        assert len(two) == len({entry["channel"] for entry in two.values()}) == 2
