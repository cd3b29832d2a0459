"""Unseen effects are in the data as their correct findings say, whatever is drawn."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.hidden.cases import _channels, _draw_two
from tests.hidden.columns import COLUMNS, firing, kind, made_of
from tests.hidden.drive import Hidden, reduced
from tests.hidden.head import nominal_beams
from tests.hidden.physics import Truth, measure
from tests.hidden.reading import LAWS
from tests.hidden.scan import Scan
from tests.hidden.truth import Finding
from tests.hidden.twin_files import read_frames, read_pattern
from tests.hidden.twin_tracing import Twin
from tests.hidden.unseen.kind import LEVELS, NotApplicableError, World
from tests.hidden.unseen.registry import FAULTS, KINDS
from tests.hidden.unseen.shapes import noise_law

_SMALL = Hidden(firings=400, every_ring=2, noise=False)
_DRAWS = 8
_CHANGES = {
    "range": "range", "shared_range": "range", "wiring": "range intensity found", "azimuth_error": "all",
    "elevation_error": "all", "intensity": "intensity", "intensity_offset": "intensity",
    "shared_intensity": "intensity",
    "drop": "found", "shared_drop": "found", "spurious": "all", "early": "all", "late": "all", "range_variance": "",
    "intensity_variance": "", "shared_azimuth": "all", "shared_elevation": "all", "shared_azimuth_error": "all",
    "shared_elevation_error": "all",
}  # fmt: skip


class Bench:
    """One frame of the twin, traced once and measured often with a thin pattern."""

    def __init__(self, base: Path) -> None:
        self.twin, frames = Twin(base / "twin"), read_frames(base)
        self.frame, self.frames = frames[-1], frames
        self.beams = nominal_beams(reduced(read_pattern(base), _SMALL))
        self.world = World.of(self.twin, frames, self.beams)
        self.bare = measure(Truth(), self.twin, self.frame, self.beams, np.random.default_rng(1), elapsed_s=6.0)

    def scan(
        self, elapsed_s: float = 6.0, effects: dict | None = None, unseen: dict | None = None, **more: dict
    ) -> Scan:
        truth = Truth(effects=effects or {}, unseen=(unseen or {}) | more)
        known = None if truth.at("aim") else (self.bare.solid, self.bare.pane)
        return measure(truth, self.twin, self.frame, self.beams, np.random.default_rng(1), elapsed_s, known)

    def draws(self, name: str) -> list[dict]:
        """Parameters at several levels; without those that this drive has nothing for."""
        found = []
        for draw in range(_DRAWS):
            try:
                found.append(KINDS[name].draw(np.random.default_rng(draw), LEVELS[draw % 4], self.world))
            except NotApplicableError:
                continue
        return found

    def moved_m(self, scan: Scan) -> np.ndarray:
        """(n,) change of range, not a number where either has no return."""
        both = scan.found & self.bare.found
        return np.where(both, scan.range_m - self.bare.range_m, np.nan)


@pytest.fixture(scope="module")
def bench(base: Path) -> Bench:
    return Bench(base)


@pytest.mark.parametrize("name", KINDS)
def test_a_kind_changes_what_its_finding_says_and_nothing_else(bench: Bench, name: str) -> None:
    bare = bench.bare
    for parameters in bench.draws(name):
        if KINDS[name].stage(parameters) in ("twin", "spread", "law"):
            continue
        scan = bench.scan(unseen={name: parameters})
        both = scan.found & bare.found
        changed = {
            "range": bool((np.abs(scan.range_m - bare.range_m)[both] > 1e-6).any()),
            "intensity": bool((np.abs(scan.intensity - bare.intensity)[both] > 1e-6).any()),
            "found": bool((scan.found != bare.found).any()),
        }
        findings = KINDS[name].truths(parameters, bench.world)
        allowed = " ".join(_CHANGES[channel] for finding in findings for channel in finding.channels)
        assert "all" in allowed or {column for column, is_so in changed.items() if is_so} <= set(allowed.split())


@pytest.mark.parametrize("name", KINDS)
def test_parameters_and_findings_survive_json(bench: Bench, name: str) -> None:
    for parameters in bench.draws(name):
        assert json.loads(json.dumps(parameters)) == parameters
        for finding in KINDS[name].truths(parameters, bench.world):
            assert Finding.from_json(json.loads(json.dumps(finding.to_json()))) == finding


def test_most_types_can_act_in_any_drive(bench: Bench) -> None:
    assert sum(bool(bench.draws(name)) for name in FAULTS) >= len(FAULTS) - 3


def test_levels_are_shares_of_the_noise(bench: Bench) -> None:
    def size(level: str, seed: int) -> float:
        return abs(KINDS["board_drift"].draw(np.random.default_rng(seed), level, bench.world)["size"])

    for level, low, high in (("quarter", 0.2, 0.3), ("half", 0.4, 0.6), ("one", 0.8, 1.2), ("strong", 2.5, 4.0)):
        for seed in range(10):
            p = KINDS["board_drift"].draw(np.random.default_rng(seed), level, bench.world)
            assert low <= abs(p["size"]) / {"range": 0.02, "intensity": 0.1}[p["channel"]] <= high
            assert size(level, seed) == abs(p["size"])


def test_an_elevation_that_depends_on_range_turns_far_beams_only(bench: Bench) -> None:
    p = {"axis": "elevation", "size_deg": 0.1, "shape": "step", "at_m": 10.0, "mean": 0.0}
    scan, distance = bench.scan(angle_by_range=p), bench.bare.solid.distance
    turned = np.degrees(scan.aim.elevation - bench.beams.elevation)
    np.testing.assert_allclose(turned[distance < 10], 0, atol=1e-9)
    np.testing.assert_allclose(turned[(distance > 10) & np.isfinite(distance)], 0.2, atol=1e-9)


def test_errors_shared_by_a_packet_are_the_same_for_all_of_its_beams(bench: Bench) -> None:
    moved = bench.moved_m(bench.scan(shared_error={"channel": "range", "unit": "packet", "firings": 4, "size": 0.02}))
    grid = moved.reshape(bench.beams.rings, -1, 4)
    spread = np.nanmax(grid, axis=(0, 2)) - np.nanmin(grid, axis=(0, 2))
    assert np.nanmax(spread) < 1e-9
    assert np.nanstd(np.nanmean(grid, axis=(0, 2))) == pytest.approx(0.02, rel=0.4)


def test_two_swapped_lasers_report_each_others_ranges(bench: Bench) -> None:
    scan, shape = bench.scan(swapped_lasers={"rings": [20, 24]}), (bench.beams.rings, -1)
    ranges, bare = scan.range_m.reshape(shape), bench.bare.range_m.reshape(shape)
    np.testing.assert_array_equal(ranges[[20, 24]], bare[[24, 20]])
    np.testing.assert_array_equal(np.delete(ranges, [20, 24], 0), np.delete(bare, [20, 24], 0))


def test_losses_of_the_head_come_in_runs_of_firings(bench: Bench) -> None:
    scan = bench.scan(loss_bursts={"scope": "head", "size": 0.2, "length": 10.0})
    lost = (bench.bare.found & ~scan.found).reshape(bench.beams.rings, -1)
    of_firing = lost.sum(0) / np.maximum(bench.bare.found.reshape(lost.shape).sum(0), 1)
    assert set(np.unique(of_firing)) <= {0.0, 1.0}
    gone = of_firing > 0
    assert 0.05 < gone.mean() < 0.4  # eight bursts on average
    assert gone.sum() / max((np.diff(gone.astype(int)) == 1).sum(), 1) > 4


def test_ranges_beyond_the_limit_fold(bench: Bench) -> None:
    limit = float(np.quantile(bench.bare.range_m[bench.bare.found], 0.9))
    scan, bare = bench.scan(range_folding={"limit_m": limit, "share": 1.0}), bench.bare
    is_far = bare.found & (bare.range_m > limit)
    both = is_far & scan.found
    np.testing.assert_allclose(scan.range_m[both], bare.range_m[both] - limit)
    np.testing.assert_array_equal(scan.range_m[~is_far], bare.range_m[~is_far])


def test_echoes_of_the_own_vehicle_are_near(bench: Bench) -> None:
    p = {"centre_rad": 0.5, "width_rad": 0.3, "rings": [20, 30], "range_m": 1.5, "share": 1.0}
    scan = bench.scan(own_vehicle=p)
    moved = scan.range_m != bench.bare.range_m
    assert moved.any()
    assert np.abs(scan.range_m[moved] - 1.5).max() < 0.5
    assert np.abs(bench.beams.azimuth[moved] - 0.5).max() < 0.151


def test_noise_grows_where_its_finding_says(bench: Bench) -> None:
    p = {"channel": "range", "by": "azimuth", "factor": 3.0, "centre_rad": 1.0, "width_rad": 0.5}
    scan = bench.scan(effects={"range_noise": {"sigma_m": 0.02}}, noise_by=p)
    moved, away = bench.moved_m(scan), np.abs(bench.beams.azimuth - 1.0)
    assert np.nanstd(moved[away < 0.1]) == pytest.approx(0.06, rel=0.15)
    assert np.nanstd(moved[away > 1.5]) == pytest.approx(0.02, rel=0.1)


def test_a_class_is_resized_in_the_written_twin_only(bench: Bench) -> None:
    frames = json.loads(json.dumps(bench.frames[:1]))
    KINDS["object_size"].act(frames, {"kind": "car", "change_m": [0.1, 0.0, 0.0]})
    for true, written in zip(bench.frames[0]["instances"], frames[0]["instances"], strict=True):
        change = written["length_m"] - true["length_m"]
        assert change == pytest.approx(0.1 if true["kind"] == "car" else 0.0, abs=1e-5)
        assert written["scale"][0] / true["scale"][0] == pytest.approx(written["length_m"] / true["length_m"])


def test_two_at_once_are_in_different_channels(bench: Bench) -> None:
    for seed in range(5):
        two = _draw_two(np.random.default_rng(seed), "strong", bench.world)
        first, second = (
            {channel for finding in KINDS[name].truths(p, bench.world) for channel in _channels(finding)}
            for name, p in two.items()
        )
        assert not first & second


@pytest.mark.parametrize("covariate", COLUMNS)
def test_columns_span_what_beams_meet(bench: Bench, covariate: str) -> None:
    inside = COLUMNS[covariate].unit(bench.bare)[bench.bare.found]
    assert ((inside >= 0) & (inside <= 1)).mean() > 0.8
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
