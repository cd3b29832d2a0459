"""What pages and lines say of a diagnosis: verdicts, findings, rivals, and what cannot be determined."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.diagnosis import headline
from cosim.discrepancy.quantities import group_words
from cosim.discrepancy.report import format_diagnosis
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.unexplained import Unexplained
from cosim.discrepancy.unknown.curve import Curve
from cosim.discrepancy.unknown.effect import UnknownEffect
from cosim.discrepancy.words import Vocabulary, implausible_spreads, source_words, unknown_words
from cosim.report import write_page
from sensors.effects.confusions import CONFUSIONS, separations
from sensors.effects.registry import effect_classes, find_effect
from tests.cosim.discrepancy.pages import diagnosis, finding, is_self_contained, opened_in_chromium


def test_the_page_of_a_diagnosis_names_effect_interval_rivals_and_the_drive_that_separates_them(tmp_path: Path) -> None:
    text = format_diagnosis(diagnosis(finding()), Vocabulary(), "drive", "my.yaml")
    assert is_self_contained(text)
    for words in (
        '<span class="warn">either</span> <b>range_walk</b> or <b>incidence_bias</b>',
        "3.1 cm",
        "2.9 cm to 3.3 cm",
        "&lt; 0.001",
        "asphalt and marking",
        "positions of scans 0.9 cm, orientations of scans 0.02° and reflectances of objects 5 %",
        "<b>either</b> range_walk <b>or</b> incidence_bias",
    ):
        assert words in text, words
    opened_in_chromium(write_page(tmp_path / "page", text))


def test_of_two_similar_effects_that_are_both_present_none_is_in_doubt() -> None:
    both = finding("range_walk", ()), finding("incidence_bias", ())
    text = format_diagnosis(diagnosis(*both), Vocabulary(), "drive", "my.yaml")
    row = text[text.index("range_walk or incidence_bias?") :]
    assert row.index("both are missing") < row.index("</tr>")


def test_a_step_that_is_exact_to_a_billionth_has_no_row_of_zeros() -> None:
    assert Vocabulary().quantity("intensity_quantization", "step", 0.01, [0.01 - 2e-10, 0.01 + 2e-10]) == "0.01 ± 2e-10"


def test_when_nothing_is_missing_page_and_line_say_so_and_what_is_detectable() -> None:
    found = replace(diagnosis(), notes=("rays/ is <absent>",))
    text, line = format_diagnosis(found, Vocabulary(), "drive", "my.yaml"), headline(found, Vocabulary())
    assert "No effect is missing" in text
    assert "encoder_eccentricity from 0.02°" in text
    assert "rays/ is &lt;absent&gt;" in text
    assert line.startswith("nothing missing: no significant effect; detectable: range_bias from 0.4 cm")
    for message in (text, line):
        assert "3.2 × the noise floor, of which poses 2.0, objects 0.2; aligned 1.030, at the noise floor" in message


def test_nothing_missing_is_never_reported_while_anything_is_listed() -> None:
    left = Unexplained("range", ("incidence", "range"), 0.004, "m", 0.003)
    found = replace(diagnosis(), unexplained=(left,))
    text, line = format_diagnosis(found, Vocabulary(), "drive", "my.yaml"), headline(found, Vocabulary())
    assert found.verdict == "unknown"
    assert "No effect is missing" not in text
    assert "0.4 cm" in text
    assert line.startswith("unexplained: range by angle of incidence and predicted range")


def test_nothing_missing_is_never_reported_above_the_noise_floor() -> None:
    found = diagnosis(aligned=1.02 * 1.08)
    text, line = format_diagnosis(found, Vocabulary(), "drive", "my.yaml"), headline(found, Vocabulary())
    assert found.verdict == "unknown"
    assert "No effect is missing" not in text
    assert "The error is above the noise floor" in text
    assert line.startswith("unexplained: the error is above the noise floor")
    assert "1.08 × the noise floor" in line


def test_a_finding_that_does_not_lower_the_error_is_marked() -> None:
    found = diagnosis(finding(also=()), first=1.03, aligned=1.04)
    text, line = format_diagnosis(found, Vocabulary(), "drive", "my.yaml"), headline(found, Vocabulary())
    assert [change.is_fall for change in found.changes] == [False]
    assert text.count("does not lower the error") == 2  # in the verdict and in the table
    assert "p < 0.001 (does not lower the error)" in line
    assert "does not lower" not in headline(diagnosis(finding(also=())), Vocabulary())


def test_changes_of_the_error_follow_the_order_in_which_effects_were_added() -> None:
    first, second = finding("range_walk", ()), finding("incidence_bias", ())
    found = diagnosis(first, second)
    steps = found.budget.steps
    swapped = replace(found, effects=(replace(first, error_before=steps[1]), replace(second, error_before=steps[0])))
    assert [change.name for change in swapped.changes] == ["incidence_bias", "range_walk"]


def test_numbers_wider_than_their_range_cannot_be_determined() -> None:
    wide = replace(finding(also=()), ci95={"amplitude_m": [0.029, 0.033], "decay": [-7e5, 7e5]})
    found = replace(diagnosis(wide), smallest_detectable={"range_bias": {"offset_m": 12.0}})
    line = headline(found, Vocabulary())
    assert "amplitude 3.10 cm ± 0.20, decay cannot be determined" in line
    json_row = found.to_json()
    assert json_row["effects"][0]["params"] == {"amplitude_m": 0.031, "decay": None}
    assert json_row["smallest_detectable"] == {"range_bias": {"offset_m": None}}
    text = format_diagnosis(found, Vocabulary(), "drive", "my.yaml")
    assert "as wide as the allowed range" in text
    assert "<td>cannot be determined</td>" in text[text.index("Smallest detectable amplitudes") :]


def test_lists_count_the_lasers_that_cannot_be_determined() -> None:
    offsets, pairs = [0.01, 0.02, 0.03], [[0.0, 0.02], [-90.0, 90.0], [0.02, 0.04]]
    line = Vocabulary().quantity("ring_range_offset", "offsets_m", offsets, pairs)
    assert line == "3 values, 1 to 3 cm; 1 cannot be determined"


def test_an_interval_that_ends_at_both_bounds_determines_nothing() -> None:
    words = Vocabulary()
    allowed = words.parameter("elevation_offset", "offset_deg")
    assert words.quantity("elevation_offset", "offset_deg", 0.1, [allowed.low, allowed.high]) == "cannot be determined"
    assert words.quantity("elevation_offset", "offset_deg", 0.1, [0.0, allowed.high]) != "cannot be determined"


@pytest.mark.parametrize(("name", "value", "words"), [("pose_shift_m", 0.5, "50 cm"), ("object_albedo", 0.6, "60 %")])
def test_implausible_spreads_are_flagged_with_limit_and_cause(name: str, value: float, words: str) -> None:
    found = replace(diagnosis(finding()), spreads={name: value, "map_m": 0.01})
    (sentence,) = implausible_spreads(found.spreads)
    assert words in sentence
    assert "exceeds the plausible limit of" in sentence
    assert "Usual causes" in sentence
    assert words in format_diagnosis(found, Vocabulary(), "drive", "my.yaml")
    assert implausible_spreads({name: value / 10}) == []


def test_alternatives_of_an_either_or_set_have_a_drive_that_separates_them() -> None:
    sets = (("range_walk [amplitude_m; decay 4]", "incidence_bias [gain_m]", "range by albedo"),)
    text = format_diagnosis(replace(diagnosis(finding(also=())), either_or=sets), Vocabulary(), "drive", "my.yaml")
    assert "<b>either</b> range_walk <b>or</b> incidence_bias <b>or</b> range by reflectance of the surface" in text
    assert "asphalt and marking" in text
    assert "Vary the reflectance of the surface while" in text


def test_hypotheses_have_names_in_words() -> None:
    assert group_words("range_walk [amplitude_m; decay 4]") == "range_walk"
    assert (
        group_words("drop by range x incidence") == "probability of a return by predicted range and angle of incidence"
    )
    assert group_words("shared_range by block") == "range error shared by each block of lasers in a scan"


def test_a_constant_curve_is_no_dependence() -> None:
    time_s = np.linspace(74, 90, 5)
    curve = Curve(
        "range", ("frame_time",), ("s",), (time_s,), np.array([0.053, 0.046, 0.041, 0.048, 0.047]), np.full(5, 0.01)
    )
    assert unknown_words(UnknownEffect.of(curve)) == "range differs by 0.047 m, regardless of time of the frame"


def test_the_line_of_a_diagnosis() -> None:
    line = headline(diagnosis(finding(also=())), Vocabulary())
    assert "range_walk (amplitude 3.10 cm ± 0.20, decay 4.00 ± 0.50), p < 0.001" in line
    assert "aligned 1.200 → 1.030, at the noise floor" in line


def test_pages_tell_the_coverage_that_a_diagnosis_used() -> None:
    narrow = replace(diagnosis(finding()), settings=Settings(coverage=0.9))
    text = format_diagnosis(narrow, Vocabulary(), "drive", "my.yaml")
    assert "<th>90 % interval</th>" in text
    assert "95 %" not in text


def test_sources_are_given_in_floors() -> None:
    parts = {"noise": 0.5, "poses": 1.55, "objects": 0.1, "map": 0.0, "missing": 0.3, "unexplained": 0.001}
    assert source_words(parts, 0.5, is_complete=False) == "poses 3.1, objects 0.2, missing effects 0.6"


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
