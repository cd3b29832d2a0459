"""Pages hold everything in one file, open without script errors, say what was found, and show its beams."""

from __future__ import annotations

import base64
import contextlib
import gzip
import io
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from cosim.cli import main
from cosim.discrepancy import compare, diagnose
from cosim.discrepancy.budget import Budget, HeldOut
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding, headline
from cosim.discrepancy.evidence_matrix import EvidenceCell, EvidenceCurve, EvidenceGrid
from cosim.discrepancy.quantities import group_words
from cosim.discrepancy.report import explored_of, format_comparison, format_diagnosis
from cosim.discrepancy.settings import Settings
from cosim.discrepancy.unexplained import Unexplained
from cosim.discrepancy.words import Vocabulary, implausible_spreads, source_words
from cosim.report import Piece, stacked_bar, write_page
from cosim.report.binned import binned, quantile_edges
from cosim.report.waterfall import waterfall
from sensors.effects.confusions import CONFUSIONS, separations
from sensors.effects.registry import effect_classes, find_effect
from sensors.sensor_model import SensorModel, load_sensor
from tests.cosim.discrepancy.small_drive import PATTERN, Yard

NASTY = "<script>alert(1)</script>\"'&"
MOST_MB = 4


def opened_in_chromium(page: Path, address: str = "") -> str:
    """The document after its scripts ran; fails on a script error, skips where there is no chromium."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no chromium here")
    command = [browser, "--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader", "--enable-logging=stderr"]
    command += [f"--user-data-dir={page.parent / 'profile'}", "--virtual-time-budget=4000", "--dump-dom"]
    result = subprocess.run([*command, page.as_uri() + address], capture_output=True, text=True, timeout=120)
    assert not re.findall(r"Uncaught|CONSOLE.*[Ee]rror", result.stderr)
    return result.stdout


def is_self_contained(text: str) -> bool:
    return not re.search(r'(?:src|href)="(?!data:|#)', text) and len(text.encode()) < MOST_MB * 1e6


def scan_data(text: str) -> dict[str, Any]:
    """What a page draws its scans from."""
    found = re.search(r'<script type="application/json" id="scan-data">(.*?)</script>', text, re.DOTALL)
    assert found
    return json.loads(found[1])


def arrays_of(scan: dict[str, Any]) -> dict[str, np.ndarray]:
    """The arrays of one scan, each (rings · columns,)."""
    buffer, offset, found = gzip.decompress(base64.b64decode(scan["data"])), 0, {}
    count = scan["rings"] * scan["columns"]
    for name, kind in scan["arrays"]:
        found[name] = np.frombuffer(buffer, np.dtype(kind).newbyteorder("<"), count, offset)
        offset += found[name].nbytes
    assert offset == len(buffer)
    return found


def targets(text: str, channel: str, covariate: str) -> dict[int, str]:
    """What each bin of a chart says, by its number."""
    pattern = rf'aria-label="([^"]*)" data-channel="{channel}" data-covariate="{covariate}" data-bin="(\d+)"'
    return {int(number): unescape(words) for words, number in re.findall(pattern, text)}


@pytest.fixture(scope="module")
def compared(biased_yard: Yard) -> str:
    """The page of a comparison with a sensor without the true bias of 4 cm."""
    return format_comparison(compare(biased_yard.drive, biased_yard.sensor), "cosim diagnose")


class ComparisonFiles(NamedTuple):
    """What `cosim diagnose` left, printed and found."""

    folder: Path
    printed: str
    diagnosis: Diagnosis


@pytest.fixture(scope="module")
def comparison_files(biased_yard: Yard, tmp_path_factory: pytest.TempPathFactory) -> ComparisonFiles:
    """The diagnosis of the same, as the command makes it."""
    folder, kept, printed = tmp_path_factory.mktemp("told"), [], io.StringIO()

    def keeping(*arguments: Any, **options: Any) -> Diagnosis:
        kept.append(diagnose(*arguments, **options))
        return kept[0]

    options = ["--sensor", str(biased_yard.sensor), "--out", "d", "--json", "d.json"]
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.chdir(folder)
        patch.setattr("cosim.discrepancy.diagnose", keeping)
        assert main(["diagnose", str(biased_yard.drive), *options]) == 0
    return ComparisonFiles(folder, printed.getvalue(), kept[0])


@pytest.fixture(scope="module")
def diagnosed(comparison_files: ComparisonFiles) -> Diagnosis:
    return comparison_files.diagnosis


@pytest.fixture(scope="module")
def diagnosed_page(comparison_files: ComparisonFiles) -> str:
    return (comparison_files.folder / "d/index.html").read_text()


def finding(effect: str = "range_walk", also: tuple[str, ...] = ("incidence_bias",)) -> Finding:
    return Finding(
        effect=effect,
        params={"amplitude_m": 0.031, "decay": 4.0},
        ci95={"amplitude_m": [0.029, 0.033], "decay": [3.5, 4.5]},
        p_value=0.0004,
        error_before=held_out(1.83),
        error_after=held_out(1.04),
        also_possible=also,
    )


def held_out(error: float) -> HeldOut:
    return HeldOut(error, error * np.array([0.98, 1.02]), np.ones(2), None)


def diagnosis(*effects: Finding, aligned: float = 1.03, first: float = 1.2) -> Diagnosis:
    ends = [first, *np.linspace(first, aligned, len(effects) + 1)[1:]] if effects else [aligned]
    missing = ends[0] - ends[-1]
    parts = {"noise": 1.02, "poses": 2.0, "objects": 0.2, "map": 0.0, "missing": missing, "unexplained": aligned - 1.02}
    steps = tuple(held_out(2.2 + end) for end in ends)
    aligned_steps = tuple(held_out(end) for end in ends)
    budget = Budget(sum(parts.values()), aligned, ends[0], 1.02, parts, steps, aligned_steps)
    return Diagnosis(
        effects=effects,
        ranking=(Alternative("range_walk", 900.0, 0.0004), Alternative("incidence_bias", 895.0, 0.001)),
        unknowns=(),
        unexplained=(),
        either_or=(),
        evidence=(),
        smallest_detectable={"range_bias": {"offset_m": 0.004}, "encoder_eccentricity": {"amplitude_deg": 0.02}},
        budget=budget,
        sensor=SensorModel(PATTERN),
        split=Split(("000000", "000001"), ("000002",)),
        spreads={"pose_shift_m": 0.009, "pose_turn_deg": 0.02, "object_albedo": 0.05},
        sensor_out="d/sensor.yaml",
    )


def test_the_page_of_a_comparison_opens_and_draws_its_points(compared: str, tmp_path: Path) -> None:
    assert is_self_contained(compared)
    assert "Above the noise floor" in compared
    document = opened_in_chromium(write_page(tmp_path / "page", compared))
    drawn = re.search(r'data-points="(\d+)"', document)
    assert drawn and int(drawn[1]) > 3000


def test_the_page_survives_any_name(biased_yard: Yard) -> None:
    sensor = load_sensor(biased_yard.sensor)
    found = compare(biased_yard.drive, SensorModel(sensor.pattern, sensor.effects, NASTY), frames=("000000",))
    assert NASTY not in format_comparison(found, NASTY)
    assert NASTY not in format_diagnosis(diagnosis(finding()), Vocabulary(), NASTY, NASTY)


def test_diagnose_writes_its_json_page_and_sensor(
    comparison_files: ComparisonFiles, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(comparison_files.folder)
    assert len(comparison_files.printed.strip().splitlines()) == 1
    found = json.loads(Path("d.json").read_text())
    assert set(found) == {
        "labels",
        "verdict",
        "effects",
        "ranking",
        "unknown",
        "unknowns",
        "unexplained",
        "either_or",
        "evidence",
        "smallest_detectable",
        "error_before",
        "error_after",
        "error_aligned",
        "budget",
        "noise_floor",
        "spreads",
        "notes",
        "sensor_out",
    }
    assert found["verdict"] in ("none", "missing", "ambiguous", "unknown")
    for one in found["effects"]:
        keys = {"effect", "params", "ci95", "p_value", "error_before", "error_after", "also_possible"}
        assert set(one) == keys
    assert found["noise_floor"] > 0
    assert sum(found["budget"].values()) == pytest.approx(found["error_before"])
    assert found["sensor_out"] == "d/sensor.yaml"
    load_sensor(found["sensor_out"])
    assert Path("d/index.html").is_file()


def test_a_bias_that_was_detected_is_removed_from_every_chart(diagnosed: Diagnosis, diagnosed_page: str) -> None:
    assert [one.effect for one in diagnosed.effects] == ["range_bias"]
    assert is_self_contained(diagnosed_page)
    message = targets(diagnosed_page, "range", "range")
    assert len(message) > 10
    for words in message.values():
        before, after = (
            float(re.findall(rf"{side} ([+−][\d.]+)", words)[0].replace("−", "-")) for side in ("before", "after")
        )
        assert before == pytest.approx(4.0, abs=0.4)
        assert after == pytest.approx(0.0, abs=0.4)


def test_beams_of_a_bin_are_those_that_of_the_chart(diagnosed: Diagnosis, diagnosed_page: str) -> None:
    explored, data = explored_of(diagnosed), scan_data(diagnosed_page)
    assert explored is not None
    for packed, scan in zip(data["scans"], explored.beams.scans, strict=True):
        assert packed["name"] == scan.name
        arrays = arrays_of(packed)
        values, bins = scan.covariates["range"].values, explored.bins["range"]
        low, high = np.concatenate([[-np.inf], bins.edges]), np.concatenate([bins.edges, [np.inf]])
        for number in targets(diagnosed_page, "range", "range"):
            inside = arrays["bin:range"] == number
            assert np.array_equal(inside, (values >= low[number]) & (values < high[number]))
        # Ranges and residuals of the picture are those of the frame, to the millimetre.
        comparison_files = arrays["1:range"] != -32768
        assert np.array_equal(comparison_files, np.isfinite(scan.after.residuals["range"]))
        assert arrays["1:range"][comparison_files] / 1000 == pytest.approx(
            scan.after.residuals["range"][comparison_files], abs=6e-4
        )
        change = (arrays["0:range"][comparison_files].astype(int) - arrays["1:range"][comparison_files]) / 1000
        assert np.median(change) == pytest.approx(0.04, abs=0.003)


def test_a_bin_that_was_picked_is_shown_with_and_without_the_finding(diagnosed_page: str, tmp_path: Path) -> None:
    page = write_page(tmp_path / "page", diagnosed_page)
    document = opened_in_chromium(page, "#channel=range&side=0&slice=material:0")
    scan = scan_data(diagnosed_page)["scans"][0]
    inside = re.search(r'data-inside="(\d+)"', document)
    assert inside and int(inside[1]) == np.count_nonzero(arrays_of(scan)["bin:material"] == 0)
    means = re.search(r'data-means="([-\d.]+) ([-\d.]+)"', document)
    assert means
    assert float(means[1]) == pytest.approx(4.0, abs=0.4)
    assert float(means[2]) == pytest.approx(0.0, abs=0.4)
    assert re.search(r'<button[^>]*data-side="0"[^>]*aria-pressed="true"', document)
    assert 'class="target picked"' in document
    assert "show all beams" in document


def test_the_bar_shows_the_parts_of_the_error(diagnosed: Diagnosis, diagnosed_page: str) -> None:
    widths = {
        name: float(share) for name, share in re.findall(r'data-part="([^"]+)" style="width:([\d.]+)%', diagnosed_page)
    }
    parts = {name: max(value, 0) for name, value in diagnosed.budget.parts.items()}
    assert sum(widths.values()) == pytest.approx(100, abs=0.1)
    assert widths["missing effects"] == pytest.approx(100 * parts["missing"] / sum(parts.values()), abs=0.01)
    assert sum(diagnosed.budget.parts.values()) == pytest.approx(diagnosed.error_before)


def test_a_part_below_zero_is_shown_and_has_no_width() -> None:
    html = stacked_bar([Piece("noise", 0.9, "gray"), Piece("poses", -0.1, "blue")], "error")
    assert 'data-part="poses"' not in html
    assert "−0.100" in html


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


@pytest.mark.parametrize(("before", "decades"), [(1.83, False), (134.0, True)])
def test_an_error_that_falls_far_is_drawn_in_decades(before: float, decades: bool) -> None:
    steps = diagnosis(finding(), first=before).budget.aligned_steps
    svg = waterfall([("", one.error, one.standard_error) for one in steps], 1.0, "error")
    assert (">10<" in svg and ">100<" in svg) == decades
    assert "noise floor" in svg


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
    assert "wider than the allowed range" in text
    assert "<td>cannot be determined</td>" in text[text.index("Smallest detectable amplitudes") :]


def test_lists_count_the_lasers_that_cannot_be_determined() -> None:
    offsets, pairs = [0.01, 0.02, 0.03], [[0.0, 0.02], [-90.0, 90.0], [0.02, 0.04]]
    line = Vocabulary().quantity("ring_range_offset", "offsets_m", offsets, pairs)
    assert line == "3 values, 1 to 3 cm; 1 cannot be determined"


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


def evidence_cell(gains: tuple[float, float], p_values: tuple[float, float]) -> EvidenceCell:
    x = np.array([10.0, 30.0, 60.0])
    curves = [EvidenceCurve(x, size * np.array([1.0, -1.0, 2.0]), np.full(3, 1e-3), "deg") for size in (0.02, 1e-4)]
    return EvidenceCell("range", ("incidence",), *(gains[0], p_values[0], gains[1], p_values[1]), "", *curves)


def test_each_cell_of_the_evidence_opens_its_chart(tmp_path: Path) -> None:
    cells = (
        evidence_cell((80.0, 0.2), (0.005, 0.9)),
        EvidenceCell("shared_range", ("firing",), 2.0, 0.3, 1.0, 0.5),
        EvidenceCell("drop", ("range", "incidence"), 40.0, 0.01, 30.0, 0.01),
    )
    text = format_diagnosis(replace(diagnosis(finding()), evidence=cells), Vocabulary(), "drive", "my.yaml")
    names = re.findall(r'data-cell="([^"]+)"', text)
    assert sorted(names) == ["drop:range+incidence", "range:incidence", "shared_range:firing"]
    assert sorted(re.findall(r'data-chart="([^"]+)"', text)) == sorted(names)
    cell = re.search(r'<button type="button" data-cell="range:incidence".*?</button>', text)
    assert cell and cell[0].endswith("<i></i><b></b></button>")  # significant before, not after
    page = write_page(tmp_path / "page", text)
    for name in names:
        document = opened_in_chromium(page, f"#cell={name}")
        shown = re.findall(r'<div data-chart="([^"]+)">', document)
        assert shown == [name]
        pressed = re.search(r'<button[^>]*data-cell="([^"]+)"[^>]*aria-pressed="true"', document)
        assert pressed and pressed[1] == name


def test_a_pair_of_covariates_is_drawn_with_both_units() -> None:
    y = np.array([[0.1, np.nan], [-0.2, 0.0]])
    grid = EvidenceGrid(np.array([10.0, 40.0]), np.array([5.0, 60.0]), y, np.full((2, 2), 0.02))
    cell = EvidenceCell(
        "range", ("range", "incidence"), 0.0, 1.0, 30.0, 0.001, "range by range x incidence", None, grid
    )
    text = format_diagnosis(replace(diagnosis(finding()), evidence=(cell,)), Vocabulary(), "drive", "my.yaml")
    chart = text[text.index('data-chart="range:range+incidence"') :]
    assert "predicted range (m)" in chart and "angle of incidence (°)" in chart
    assert "predicted range 10 m, angle of incidence 5 °: measured − predicted range (cm) 10 [6, 14]" in chart
    assert chart.count("<title>predicted range") == 3  # bins without beams stay empty


def test_a_cell_is_significant_by_the_rule_that_selects_terms(diagnosed: Diagnosis, diagnosed_page: str) -> None:
    by = diagnosed.settings
    significant = {
        f"{cell.channel}:{'+'.join(cell.covariates)}"
        for cell in diagnosed.evidence
        if cell.p_value_after <= by.selection.level and cell.gain_after >= by.selection.least_gain
    }
    buttons = re.findall(r'<button type="button" data-cell="([^"]+)"[^>]*>(.*?)</button>', diagnosed_page)
    assert len(buttons) > 20
    assert {name for name, halves in buttons if halves.endswith(("<i></i>", '<i class="weak"></i>'))} == significant


def test_charts_of_residuals_claim_no_significance(diagnosed: Diagnosis) -> None:
    assert diagnosed.frame_pairs is not None
    initial = replace(diagnosed.frame_pairs, after=diagnosed.frame_pairs.before)
    denied = replace(diagnosed, effects=(), unexplained=(), evidence=(), frame_pairs=initial)
    text = format_diagnosis(denied, Vocabulary(), "drive", "my.yaml", explored_of(denied))
    assert "It shows where residuals are, not what is significant" in text


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


def test_bands_grow_when_beams_of_a_frame_share_an_error() -> None:
    rng = np.random.default_rng(0)
    frame = np.repeat(np.arange(20), 500)
    x = rng.uniform(0, 1, len(frame))
    alone = rng.normal(0, 1, len(frame))
    shared = alone + rng.normal(0, 1, 20)[frame]
    bins = np.searchsorted(quantile_edges(x, 5), x)
    narrow, wide = binned(x, bins, alone, frame), binned(x, bins, shared, frame)
    assert np.all(narrow.count == pytest.approx(2000, abs=1))
    assert np.median(wide.half) > 5 * np.median(narrow.half)
    assert np.all(np.abs(narrow.mean) < 2.5 * narrow.half)


def test_a_dependence_has_the_strength_of_its_means() -> None:
    rng = np.random.default_rng(1)
    x, frame = rng.uniform(-1, 1, 20_000), rng.integers(0, 10, 20_000)
    bins = np.searchsorted(quantile_edges(x, 20), x)
    found = binned(x, bins, 3 * x + rng.normal(0, 1, len(x)), frame)
    assert found.strength == pytest.approx(3 / np.sqrt(3), rel=0.03)
    assert found.p_value < 1e-6
    nothing = binned(x, bins, rng.normal(0, 1, len(x)), frame)
    assert nothing.size < 0.03
    assert nothing.p_value > 0.01
