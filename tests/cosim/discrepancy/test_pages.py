"""Pages of measured drives: everything in one file, no script errors, what was found, and its beams."""

from __future__ import annotations

import base64
import contextlib
import gzip
import io
import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from cosim.cli import main
from cosim.discrepancy import compare, diagnose
from cosim.discrepancy.diagnosis import Diagnosis
from cosim.discrepancy.report import explored_of, format_comparison, format_diagnosis
from cosim.discrepancy.words import Vocabulary
from cosim.report import write_page
from sensors.sensor_model import SensorModel, load_sensor
from tests.cosim.discrepancy.pages import diagnosis, finding, is_self_contained, opened_in_chromium
from tests.cosim.discrepancy.small_drive import Yard

NASTY = "<script>alert(1)</script>\"'&"


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
