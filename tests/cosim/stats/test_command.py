"""The command writes a whole page and strict JSON, and says what is absent."""

from __future__ import annotations

import json
import re
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cosim.cli import main


def page(folder: Path) -> str:
    return (folder / "index.html").read_text(encoding="utf-8")


def test_one_set(drive: Path, tmp_path: Path) -> None:
    result = tmp_path / "r.json"
    assert main(["stats", str(drive), "--out", str(tmp_path / "page"), "--json", str(result), "--quiet"]) == 0
    content = json.loads(result.read_text())
    assert content["set"]["labels"]["classes"] == {"Car": 3, "Pedestrian": 1}
    assert content["against"] is None
    assert content["distances"] is None
    assert "From above" in page(tmp_path / "page")


def test_two_sets_of_different_kind(drive: Path, labels_only: Path, tmp_path: Path) -> None:
    result = tmp_path / "r.json"
    command = ["stats", str(drive), "--against", str(labels_only), "--out", str(tmp_path / "page")]
    assert main([*command, "--json", str(result), "--quiet"]) == 0
    content = json.loads(result.read_text(), parse_constant=lambda word: pytest.fail(f"{word} is no JSON"))
    assert content["distances"]["distance"]["wasserstein"] == pytest.approx(0, abs=1e-5)
    assert "intensity" not in content["distances"]
    assert "velodyne/ is absent" in page(tmp_path / "page")


def test_the_page_stands_alone_and_its_pictures_are_well_formed(drive: Path, tmp_path: Path) -> None:
    main(["stats", str(drive), "--against", str(drive), "--out", str(tmp_path), "--quiet"])
    text = page(tmp_path)
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    assert "<script" not in text
    pictures = re.findall(r'<svg class="plot".*?</svg><path.*?</svg>', text, re.S)
    assert len(pictures) > 15
    for picture in pictures:
        ElementTree.fromstring(picture)
        assert "nan" not in picture.replace("base64", "").lower().split("data:image")[0]


def test_the_page_is_next_to_the_drive_by_default(drive: Path) -> None:
    assert main(["stats", str(drive), "--quiet"]) == 0
    assert (drive.parent / "small-stats/index.html").is_file()


def test_a_side_without_labels_is_said(drive: Path, labels_only: Path, tmp_path: Path) -> None:
    for file in (drive / "label_2").iterdir():
        file.unlink()
    assert main(["stats", str(drive), "--against", str(labels_only), "--out", str(tmp_path), "--quiet"]) == 0
    assert "nothing in common" in page(tmp_path)
    assert "label_2/ is absent" in page(tmp_path)


def test_drives_without_any_object_are_no_fault(drive: Path, tmp_path: Path) -> None:
    for file in (drive / "label_2").iterdir():
        file.write_text("")
    assert main(["stats", str(drive), "--against", str(drive), "--out", str(tmp_path), "--quiet"]) == 0
    assert "no frame has a labelled object" in page(tmp_path)


@pytest.mark.parametrize("fault", ["absent", "empty", "broken label"])
def test_bad_input_is_a_line_and_exit_2(
    drive: Path, tmp_path: Path, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    target = drive
    if fault == "absent":
        target = tmp_path / "nowhere"
    elif fault == "empty":
        for file in (drive / "velodyne").iterdir():
            file.unlink()
    else:
        (drive / "label_2/000001.txt").write_text("Car 0 0\n")
    assert main(["stats", str(target), "--quiet"]) == 2
    message = capsys.readouterr().err
    assert message.startswith("cosim stats: ")
    assert message.count("\n") == 1


def test_a_third_set_is_held_against_the_same_reference(drive: Path, labels_only: Path, tmp_path: Path) -> None:
    result = tmp_path / "r.json"
    command = ["stats", str(drive), "--against", str(labels_only), "--beside", str(drive), "--out", str(tmp_path)]
    assert main([*command, "--json", str(result), "--quiet"]) == 0
    content = json.loads(result.read_text())
    assert content["beside"]["distances"] == content["distances"]
    assert page(tmp_path).count("<h2>Distances of") == 2


def test_a_third_set_without_a_reference_is_refused(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["stats", str(drive), "--beside", str(drive), "--quiet"]) == 2
    assert "--against" in capsys.readouterr().err


def test_a_folder_of_several_drives_names_them(drive: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("lidar", "radar"):
        (tmp_path / "set" / name / "training/velodyne").mkdir(parents=True)
    assert main(["stats", str(tmp_path / "set"), "--quiet"]) == 2
    assert "give one of the drives in it: lidar, radar" in capsys.readouterr().err
