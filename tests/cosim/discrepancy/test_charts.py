"""Charts of pages: parts of the error, its fall, the evidence, and means with their bands."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.evidence_matrix import EvidenceCell, EvidenceCurve, EvidenceGrid
from cosim.discrepancy.report import format_diagnosis
from cosim.discrepancy.words import Vocabulary
from cosim.report import Piece, stacked_bar, write_page
from cosim.report.binned import binned, quantile_edges
from cosim.report.waterfall import waterfall
from tests.cosim.discrepancy.pages import diagnosis, finding, opened_in_chromium


def test_a_part_below_zero_is_shown_and_has_no_width() -> None:
    html = stacked_bar([Piece("noise", 0.9, "gray"), Piece("poses", -0.1, "blue")], "error")
    assert 'data-part="poses"' not in html
    assert "−0.100" in html


@pytest.mark.parametrize(("before", "decades"), [(1.83, False), (134.0, True)])
def test_an_error_that_falls_far_is_drawn_in_decades(before: float, decades: bool) -> None:
    steps = diagnosis(finding(), first=before).budget.aligned_steps
    svg = waterfall([("", one.error, one.standard_error) for one in steps], 1.0, "error")
    assert (">10<" in svg and ">100<" in svg) == decades
    assert "noise floor" in svg


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
