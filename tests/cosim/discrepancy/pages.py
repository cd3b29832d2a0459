"""Diagnoses made of given numbers, and how their pages are opened."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cosim.discrepancy.budget import Budget, HeldOut
from cosim.discrepancy.data.split import Split
from cosim.discrepancy.diagnosis import Alternative, Diagnosis, Finding
from sensors.sensor_model import SensorModel
from tests.cosim.discrepancy.small_drive import PATTERN

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
