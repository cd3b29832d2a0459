"""A calibration is recommended only where the error of held-out scans falls beyond doubt."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.recordings.calibration.acceptance import SCORES, accept
from cosim.recordings.calibration.directions import direction_error
from cosim.recordings.calibration.estimates import combine, differences
from cosim.recordings.calibration.held_out import change_between, read_scores, write_scores
from cosim.recordings.calibration.rounds import Round
from sensors.effects.beams.elevation_offset import ElevationOffset
from sensors.effects.channels import ElevationError
from sensors.pattern import load_pattern

BEAMS = 2000


def scores(shift: float = 0.0, scans: int = 8, spread: float = 0.02, seed: int = 0) -> dict:
    """Range scores of a model whose error differs by about `shift` in each scan."""
    rng, own = np.random.default_rng(0), np.random.default_rng(seed)
    found = {}
    for number in range(scans):
        values = rng.gamma(2.0, 0.01, BEAMS) + 0.01 * (shift + own.normal(0, spread))
        found[f"{10 * number:06d}"] = {"range": values.astype(np.float32)}
    return found


def made(folder: Path, number: int, given: dict, accepted: dict, transfers: list | None = None) -> Round:
    path = folder / f"round_{number}"
    path.mkdir(parents=True)
    write_scores(path / SCORES, {"given": given, "accepted": accepted})
    empty: dict = {name: None for name in Round.__dataclass_fields__}
    own = {"number": number, "sensor_out": f"round_{number}/sensor.yaml", "accepted": f"round_{number}/accepted.yaml"}
    lists = {"findings": [{"effect": "range_walk"}], "unknowns": [], "refitted": {}, "limits": ["is straight"]}
    return Round(**{**empty, **own, **lists, "transfers": transfers or []})


def test_scores_are_kept_as_they_were(tmp_path: Path) -> None:
    written = {"given": scores(), "accepted": scores(-0.5)}
    write_scores(tmp_path / SCORES, written)
    for model, scans in read_scores(tmp_path / SCORES).items():
        for name, channels in scans.items():
            np.testing.assert_array_equal(channels["range"], written[model][name]["range"])


def test_a_fall_is_recommended_and_a_rise_is_not(tmp_path: Path) -> None:
    better = accept(tmp_path, [made(tmp_path, 1, scores(), scores(-0.3, seed=1))])
    assert better.is_recommended and better.round == 1 and better.change is not None and better.change.high < 0
    worse = accept(tmp_path / "b", [made(tmp_path / "b", 1, scores(), scores(0.25, seed=1))])
    assert (
        not worse.is_recommended and worse.round == 0 and "rises by" in worse.reason and "is straight" in worse.reason
    )


def test_a_change_that_may_be_none_is_not_recommended(tmp_path: Path) -> None:
    found = accept(tmp_path, [made(tmp_path, 1, scores(), scores(-0.01, spread=0.1, seed=1))])
    assert not found.is_recommended and "includes no change" in found.reason
    few = accept(tmp_path / "b", [made(tmp_path / "b", 1, scores(scans=2), scores(-0.5, scans=2))])
    assert not few.is_recommended and "too few held-out scans" in few.reason


def test_a_certain_fall_that_is_of_no_use_is_not_recommended(tmp_path: Path) -> None:
    tiny = accept(tmp_path, [made(tmp_path, 1, scores(), scores(-2e-5))])
    assert tiny.change is not None and tiny.change.high < 0
    assert not tiny.is_recommended and "falls by less than 0.1 %" in tiny.reason


def test_the_best_round_is_chosen_not_the_last(tmp_path: Path) -> None:
    rounds = [
        made(tmp_path, 1, scores(), scores(-0.5, seed=1)),
        made(tmp_path, 2, scores(-0.4, seed=2), scores(-0.2, seed=3)),
    ]
    assert accept(tmp_path, rounds).round == 1


def test_of_rounds_that_are_equally_good_the_last_is_chosen(tmp_path: Path) -> None:
    rounds = [
        made(tmp_path, 1, scores(), scores(-0.5, seed=1)),
        made(tmp_path, 2, scores(-0.5, seed=2), scores(-0.499, seed=3)),
    ]
    assert accept(tmp_path, rounds).round == 2


def test_a_finding_that_moves_points_is_validated_on_the_next_map(tmp_path: Path) -> None:
    found = {"effect": "sweep_motion", "change": 0.0, "low": -0.1, "high": 0.1, "by": "step", "is_accepted": True}
    rounds = [
        made(tmp_path, 1, scores(), scores(-0.3, seed=1), [found]),
        made(tmp_path, 2, scores(-0.3, seed=2), scores(-0.3, seed=3)),
    ]
    transfer = accept(tmp_path, rounds).transfers[0]
    assert transfer.by == "map" and transfer.is_accepted
    alone = accept(tmp_path / "b", [made(tmp_path / "b", 1, scores(), scores(), [found])]).transfers[0]
    assert not alone.is_accepted, "nothing confirms it"


def test_only_beams_that_both_models_compare_count() -> None:
    before, after = scores(), scores()
    for channels in after.values():
        channels["range"][:500] = np.nan  # the difficult ones have left the map
    for channels in before.values():
        channels["range"][:500] += 1.0
    change = change_between(before, after)
    assert change is not None and change.mean == pytest.approx(0, abs=1e-6) and not change.is_fall


def test_neighbouring_scans_are_no_independent_evidence() -> None:
    rng = np.random.default_rng(3)
    stretches = np.repeat(rng.normal(0, 0.2, 4), 4)
    names = [f"{100 * (n // 4) + n % 4:06d}" for n in range(16)]
    base = np.full(BEAMS, 0.02, np.float32)
    before = {name: {"range": base} for name in names}
    after = {name: {"range": base + np.float32(0.01 * own)} for name, own in zip(names, stretches, strict=True)}
    alone = {f"{100 * n:06d}": one for n, one in enumerate(after.values())}
    clustered = change_between(before, after)
    independent = change_between({name: {"range": base} for name in alone}, alone)
    assert clustered is not None and independent is not None
    assert clustered.high - clustered.low > 1.5 * (independent.high - independent.low)


def test_drives_are_combined_and_differences_are_family_wise() -> None:
    key = ("elevation_offset", "offset_deg")
    lasers = {("ring_gain", "gains"): ([1.0] * 16, [[0.9, 1.1]] * 16)}
    first, second = {key: (0.20, [0.16, 0.24]), **lasers}, {key: (0.22, [0.18, 0.26]), **lasers}
    third = {key: (0.60, [0.56, 0.64]), **lasers}
    together = combine([first, second])[0]
    assert together.mean == pytest.approx(0.21, abs=1e-3) and together.p_agree is not None and together.p_agree > 0.3
    assert together.mean_high - together.mean_low < 0.08
    similar, unlike = differences("ab", [first, second]), differences("ab", [first, third])
    assert not any(one.is_significant for one in similar)
    assert unlike[0].effect == "elevation_offset" and unlike[0].is_significant and len(unlike) == 17
    assert unlike[0].difference == pytest.approx(0.4) and all(not one.is_significant for one in unlike[1:])


def test_ray_directions_differ_by_the_angle_that_one_is_turned_by() -> None:
    pattern = load_pattern("vlp16")
    same = direction_error(pattern, pattern)
    assert same is not None and same.mean_deg < 1e-4 and same.lasers == 16
    turned = direction_error(pattern, pattern, (), (ElevationOffset(offset_deg=0.15),))
    assert turned is not None
    assert turned.mean_deg == pytest.approx(0.15, abs=1e-3) and turned.max_deg == pytest.approx(0.15, abs=1e-3)
    assert turned.by_elevation_deg == 0


class IncidenceError(ElevationError):
    """Beams that graze a surface point elsewhere."""

    name = "by_incidence"
    covariates = ("incidence",)

    def error(self, incidence: np.ndarray) -> np.ndarray:
        return 1e-3 * incidence


def test_errors_that_depend_on_surfaces_are_no_directions_of_the_sensor() -> None:
    pattern = load_pattern("vlp16")
    found = direction_error(pattern, pattern, (), (IncidenceError(),))
    assert found is not None and found.max_deg == pytest.approx(0, abs=1e-6)
