"""Labels that are too small are distinguished from noisy labels, on a traced town."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hidden.labels import shrink_labels


def test_a_hidden_shrinking_of_labels_is_detected(base: Path, tmp_path: Path) -> None:
    from cosim.drives.kitti import Drive
    from cosim.labels.bias import diagnose_labels

    shrink_labels(base, tmp_path / "small", (0.2, 0.05, 0.05), (0.25, 0.25, 0.05), jitter_m=0.02, seed=1)
    found = diagnose_labels(Drive(tmp_path / "small"))
    assert found.verdict == "missing"
    assert found.a_m == pytest.approx((0.2, 0.05, 0.05), abs=0.04)
    assert found.b[:2] == pytest.approx((0.25, 0.25), abs=0.08)


def test_unsteady_labels_are_no_bias(base: Path, tmp_path: Path) -> None:
    """Not oftener than a level of 5 % has it: of six drives three or more would say so in one of 450 cases."""
    from cosim.drives.kitti import Drive
    from cosim.labels.bias import diagnose_labels

    message = []
    for seed in range(1, 7):
        shrink_labels(base, tmp_path / f"unsteady{seed}", (0, 0, 0), (0, 0, 0), jitter_m=0.05, seed=seed)
        message.append(diagnose_labels(Drive(tmp_path / f"unsteady{seed}")).verdict)
    assert message.count("none") >= 4
