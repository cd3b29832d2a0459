"""What cannot be used is refused in one line that tells what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from cosim.cli import main

HEADER = "time_s,id,x_m,y_m,speed_mps,heading_deg,lane,type"
Rows = list[str]


def sample(time_s: object, name: str = "a", speed: object = 5.0, lane: str = "A0_A1_1") -> str:
    return f"{time_s},{name},0,0,{speed},90,{lane},car"


GOOD = [sample(t, name) for name in ("a", "b") for t in (0.0, 0.1, 0.2)]


@pytest.mark.parametrize(
    ("header", "rows", "says"),
    [
        (HEADER.replace(",lane", ""), [], "lacks the columns lane"),
        (HEADER, [], "holds no samples"),
        (HEADER, [*GOOD, sample(0.3, "a", "nan")], "speed_mps is nan in line 8"),
        (HEADER, [*GOOD, sample("soon")], "time_s is 'soon' in line 8"),
        (HEADER, [*GOOD, sample(0.2)], "must increase for each vehicle"),
        (HEADER, [sample(t) for t in (0.0, 0.1)], "holds one vehicle only ('a')"),
        (HEADER, [sample(t, n, -1) for n in "ab" for t in (0.0, 0.1)], "speeds are not negative"),
        (HEADER, [*GOOD, "1,2"], "has 2 values"),
        (HEADER, [sample(0), sample(1, "b")], "last 1.0 s"),
        (HEADER, [sample(t, n, 5, "nowhere_0") for n in "ab" for t in (0, 20)], "lane 'nowhere_0' is not in the town"),
        (HEADER, [sample(t, n, 5, "") for n in "ab" for t in (0, 20)], "no sample lies on a lane of cars"),
    ],
)
@pytest.mark.parametrize("command", ["traffic-compare", "traffic-diagnose"])
def test_bad_trajectories(tmp_path: Path, capsys, command: str, header: str, rows: Rows, says: str) -> None:
    measured, config = tmp_path / "m.csv", tmp_path / "run.yaml"
    measured.write_text("\n".join([header, *rows, ""]))
    config.write_text("town: town01\n")
    assert main([command, str(measured), "--config", str(config)]) == 2
    told = capsys.readouterr().err
    assert says in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda folder: (folder / "m.csv").unlink(), "cannot read"),
        (lambda folder: (folder / "m.csv").write_text(""), "is empty"),
        (lambda folder: (folder / "m.csv").write_bytes(b"\xff\xfe\x00"), "is not CSV"),
        (lambda folder: (folder / "run.yaml").write_text("town: atlantis\n"), "'atlantis' does not exist"),
        (lambda folder: (folder / "run.yaml").write_text("twon: town01\n"), "twon"),
    ],
)
def test_bad_files(tmp_path: Path, capsys, damage: Callable[[Path], object], says: str) -> None:
    (tmp_path / "m.csv").write_text("\n".join([HEADER, *(sample(t, n) for n in "ab" for t in (0, 20)), ""]))
    (tmp_path / "run.yaml").write_text("town: town01\n")
    damage(tmp_path)
    assert main(["traffic-compare", str(tmp_path / "m.csv"), "--config", str(tmp_path / "run.yaml")]) == 2
    assert says in capsys.readouterr().err
