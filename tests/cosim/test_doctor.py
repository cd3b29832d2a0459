"""What `cosim doctor` says is what holds when the parts are used."""

from __future__ import annotations

import json
import subprocess
from importlib.metadata import version

import pytest

from cosim import doctor
from cosim.cli import main
from cosim.doctor import CheckResult, can_record, examine


@pytest.fixture(scope="module")
def reports(tmp_path_factory) -> dict[str, dict]:
    file = tmp_path_factory.mktemp("doctor") / "found.json"
    assert main(["doctor", "--quiet", "--json", str(file)]) == 0
    found = json.loads(file.read_text())
    assert found["can_record"]
    return {part["name"]: part for part in found["parts"]}


def test_every_part_is_looked_at_in_ten_lines(reports):
    assert list(reports) == ["Python", "SUMO", "Embree", "OSMesa", "EGL", "torch", "GPU", "rerun", "Dask", "chromium"]
    assert all(bool(part["found"]) == part["works"] for part in reports.values())
    assert all(part["remedy"] for name, part in reports.items() if name != "Python")


def test_what_these_tests_themselves_use_works(reports):
    assert version("libsumo") in reports["SUMO"]["found"]
    assert reports["Embree"]["found"] == f"embreex {version('embreex')}"
    assert reports["OSMesa"]["works"] or reports["EGL"]["works"]
    assert reports["Python"]["works"]


def test_a_part_that_fails_or_prints_nothing_is_missing_with_its_remedy(monkeypatch):
    monkeypatch.setattr(doctor, "_SUMO", "raise SystemExit('no library')")
    monkeypatch.setattr(doctor, "_RAYS", "pass")
    findings = {}
    for finding in examine():
        findings[finding.name] = finding
        if finding.name == "Embree":
            break
    assert findings["SUMO"].line() == "missing  SUMO: pip install eclipse-sumo libsumo sumolib (traffic)"
    assert not findings["Embree"].works


def test_a_program_that_hangs_counts_as_missing(monkeypatch):
    def hangs(*_, timeout, **__):
        raise subprocess.TimeoutExpired("sumo", timeout)

    monkeypatch.setattr(subprocess, "run", hangs)
    assert not any(one.works for one in examine() if one.name in ("SUMO", "Embree", "OSMesa", "EGL"))


def test_one_way_to_draw_is_enough_and_none_is_too_few(monkeypatch, capsys):
    def part(name: str, works: bool, needed: bool = False) -> CheckResult:
        return CheckResult(name, works, "1.0" if works else "", "images", "apt-get install it", needed)

    sumo, osmesa, egl = part("SUMO", True, True), part("OSMesa", False), part("EGL", True)
    assert can_record([sumo, osmesa, egl])
    assert not can_record([sumo, osmesa, part("EGL", False)])
    assert not can_record([part("SUMO", False, True), osmesa, egl])
    monkeypatch.setattr(doctor, "examine", lambda: iter([sumo, osmesa, part("EGL", False)]))
    assert main(["doctor"]) == 2
    message = capsys.readouterr()
    assert "missing  OSMesa: apt-get install it (images)" in message.out
    assert "cosim run does not work here: OSMesa is missing" in message.err
