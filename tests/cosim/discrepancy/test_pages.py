"""Pages hold everything in one file, open without script errors, and say first what to do."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy import compare
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding
from cosim.discrepancy.report import Gathered, format_comparison, format_diagnosis, write_page
from cosim.discrepancy.report.binned import binned, in_quantiles
from cosim.discrepancy.report.confusions import CONFUSIONS, separations
from cosim.discrepancy.report.sentences import Vocabulary, headline
from cosim.discrepancy.report.waterfall import waterfall
from cosim.discrepancy.validation import HeldOut
from sensors.effects.registry import effect_classes, find_effect
from sensors.sensor_model import SensorModel, load_sensor
from tests.cosim.discrepancy.small_drive import PATTERN, Yard

NASTY = "<script>alert(1)</script>\"'&"


def opened_in_chromium(page: Path) -> str:
    """The document after its scripts ran; fails on a script error, skips where there is no chromium."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no chromium here")
    command = [browser, "--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--enable-logging=stderr"]
    command += [f"--user-data-dir={page.parent / 'profile'}", "--virtual-time-budget=4000", "--dump-dom", page.as_uri()]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert not re.findall(r"Uncaught|CONSOLE.*[Ee]rror", result.stderr)
    return result.stdout


def is_self_contained(text: str) -> bool:
    return not re.search(r'(?:src|href)="(?!data:|#)', text)


def comparison(yard: Yard, title: str = "my.yaml") -> str:
    sensor = load_sensor(yard.sensor)
    gathered = Gathered(sensor.effects, ("000000", "000004"))
    found = compare(yard.drive, SensorModel(sensor.pattern, sensor.effects, title), on_frame=gathered)
    return format_comparison(found, gathered.rows(), gathered.scans(), "cosim diagnose")


def finding(effect: str = "range_walk", also: tuple[str, ...] = ("incidence_bias",)) -> Finding:
    return Finding(
        effect=effect,
        params={"amplitude_m": 0.031, "decay": 4.0},
        ci95={"amplitude_m": [0.029, 0.033], "decay": [3.5, 4.5]},
        p_value=0.0004,
        error_before=HeldOut(1.83, np.array([1.8, 1.86]), np.ones(2), 1.02),
        error_after=HeldOut(1.04, np.array([1.02, 1.06]), np.ones(2), 1.02),
        also_possible=also,
        delta_bic=900.0,
    )


def diagnosis(*effects: Finding) -> Diagnosis:
    return Diagnosis(
        verdict="ambiguous" if effects else "none",
        effects=effects,
        ranking=(Alternative("range_walk", 900.0, 0.0004), Alternative("incidence_bias", 895.0, 0.001)),
        unknown=None,
        smallest_detectable={"range_bias": {"offset_m": 0.004}, "encoder_eccentricity": {"amplitude_deg": 0.02}},
        error_before=1.83,
        error_after=1.04 if effects else 1.83,
        noise_floor=1.02,
        sensor=SensorModel(PATTERN),
        split=Split(("000000", "000001"), ("000002",)),
        sensor_out="d/sensor.yaml",
    )


def test_the_page_of_a_comparison_opens_and_draws_its_points(biased_yard: Yard, tmp_path: Path) -> None:
    text = comparison(biased_yard)
    assert is_self_contained(text)
    assert "Above the noise floor" in text
    document = opened_in_chromium(write_page(tmp_path / "page", text))
    drawn = re.search(r'data-points="(\d+)"', document)
    assert drawn and int(drawn[1]) > 3000


def test_the_page_survives_any_name(biased_yard: Yard) -> None:
    assert NASTY not in comparison(biased_yard, NASTY)
    assert NASTY not in format_diagnosis(diagnosis(finding()), Vocabulary(), NASTY, NASTY)


def test_a_bias_is_seen_against_every_covariate_but_depends_on_none(biased_yard: Yard) -> None:
    text = comparison(biased_yard)
    assert "+4.0" in text or "+3.9" in text
    ranges = text[text.index("Range: what the residual depends on") : text.index("Intensity: what")]
    assert "no dependence beyond chance" in ranges


def test_the_page_of_a_diagnosis_names_effect_interval_rivals_and_the_drive_that_tells(tmp_path: Path) -> None:
    text = format_diagnosis(diagnosis(finding()), Vocabulary(), "drive", "my.yaml")
    assert is_self_contained(text)
    for words in (
        "range_walk",
        "3.1 cm",
        "2.9 cm to 3.3 cm",
        "&lt; 0.001",
        "incidence_bias",
        "asphalt beside road marking",
    ):
        assert words in text, words
    opened_in_chromium(write_page(tmp_path / "page", text))


def test_of_two_that_look_alike_and_are_both_there_none_is_in_doubt() -> None:
    both = finding("range_walk", ()), finding("incidence_bias", ())
    text = format_diagnosis(diagnosis(*both), Vocabulary(), "drive", "my.yaml")
    row = text[text.index("range_walk or incidence_bias?") :]
    assert row.index("both are missing") < row.index("</tr>")


@pytest.mark.parametrize(("before", "decades"), [(1.83, False), (134.0, True)])
def test_an_error_that_falls_far_is_drawn_in_decades(before: float, decades: bool) -> None:
    found = replace(finding(), error_before=HeldOut(before, np.array([0.9, 1.1]) * before, np.ones(2), 1.02))
    svg = waterfall(replace(diagnosis(found), error_before=before))
    assert (">10<" in svg and ">100<" in svg) == decades
    assert "noise floor" in svg


def test_a_step_that_is_exact_to_a_billionth_has_no_row_of_zeros() -> None:
    assert Vocabulary().quantity("intensity_quantization", "step", 0.01, [0.01 - 2e-10, 0.01 + 2e-10]) == "0.01 ± 2e-10"


def test_when_nothing_is_missing_the_page_says_what_would_have_shown() -> None:
    text = format_diagnosis(diagnosis(), Vocabulary(), "drive", "my.yaml")
    assert "Nothing is missing that would show" in text
    assert "range_bias from 4 mm" in text or "range_bias from 0.4 cm" in text
    assert "encoder_eccentricity from 0.02°" in text
    assert "Yet the held-out error, 1.830, is 79% above the noise floor (1.020)" in text


def test_nothing_missing_at_the_floor_is_no_reason_to_doubt() -> None:
    found = replace(diagnosis(), error_before=1.03, error_after=1.03, notes=("rays/ is <absent>",))
    text = format_diagnosis(found, Vocabulary(), "drive", "my.yaml")
    assert "The held-out error is 1.030, at the noise floor (1.020)." in text
    assert "rays/ is &lt;absent&gt;" in text
    assert "noise floor" not in headline(found, Vocabulary())


def test_the_line_of_a_diagnosis() -> None:
    line = headline(diagnosis(finding(also=())), Vocabulary())
    assert "range_walk (amplitude 3.10 cm ± 0.20, decay 4.00 ± 0.50), p < 0.001" in line
    assert "1.830 → 1.040" in line
    nothing = headline(diagnosis(), Vocabulary())
    assert nothing.startswith("nothing missing")
    assert nothing.endswith("yet the held-out error, 1.830, is 79% above the noise floor (1.020)")


def test_confusions_name_effects_that_exist() -> None:
    names = set(effect_classes())
    assert {name for one in CONFUSIONS for name in (*one.one, *one.other)} <= names
    assert separations("sweep_motion", "time_offset") == separations("time_offset", "sweep_motion") != ()


def test_declared_confusions_of_the_specified_pairs_have_a_remedy() -> None:
    pairs = [
        ("mount_rotation", "elevation_offset"),
        ("range_bias", "mount_translation"),
        ("atmospheric_extinction", "focal_response"),
        ("range_walk", "incidence_bias"),
        ("sweep_motion", "time_offset"),
    ]
    for one, other in pairs:
        assert separations(one, other), (one, other)
        assert find_effect(one)


def test_bands_grow_when_beams_of_a_frame_share_an_error() -> None:
    rng = np.random.default_rng(0)
    frame = np.repeat(np.arange(20), 500)
    x = rng.uniform(0, 1, len(frame))
    alone = rng.normal(0, 1, len(frame))
    shared = alone + rng.normal(0, 1, 20)[frame]
    bins = in_quantiles(x, 5)
    narrow, wide = binned(x, bins, alone, frame), binned(x, bins, shared, frame)
    assert np.all(narrow.count == pytest.approx(2000, abs=1))
    assert np.median(wide.half) > 5 * np.median(narrow.half)
    assert np.all(np.abs(narrow.mean) < 2.5 * narrow.half)


def test_a_dependence_has_the_strength_of_its_means() -> None:
    rng = np.random.default_rng(1)
    x, frame = rng.uniform(-1, 1, 20_000), rng.integers(0, 10, 20_000)
    found = binned(x, in_quantiles(x, 20), 3 * x + rng.normal(0, 1, len(x)), frame)
    assert found.strength == pytest.approx(3 / np.sqrt(3), rel=0.03)
    assert binned(x, in_quantiles(x, 20), rng.normal(0, 1, len(x)), frame).strength < 0.03
