"""A damaged scan stops a recording, unless it is to be left out; then it is counted and named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.recordings import RecordingError, open_recording


def pcd(points: np.ndarray) -> bytes:
    head = f"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH {len(points)}\nHEIGHT 1\nDATA binary\n"
    return head.encode() + points.astype("<f4").tobytes()


def test_a_scan_that_is_cut_off_is_left_out_only_if_that_is_wanted(tmp_path: Path) -> None:
    points = np.random.default_rng(0).uniform(1, 20, (50, 3))
    for number in range(6):
        (tmp_path / f"{number:06d}.pcd").write_bytes(pcd(points + number))
    (tmp_path / "times.txt").write_text("".join(f"{0.1 * number}\n" for number in range(6)))
    whole = (tmp_path / "000002.pcd").read_bytes()
    (tmp_path / "000002.pcd").write_bytes(whole[:-100])
    with pytest.raises(RecordingError, match=r"cut off.*--skip-damaged"):
        list(open_recording(tmp_path))
    recording = open_recording(tmp_path, skip_damaged=True)
    assert [scan.name for scan in recording] == ["000000", "000001", "000003", "000004", "000005"]
    assert any("1 of 6 scans cannot be read and are left out: 000002" in note for note in recording.notes)
    np.testing.assert_allclose(recording.stamp_s, [0, 0.1, 0.3, 0.4, 0.5])  # type: ignore[arg-type]
    assert recording.turns(0.1)[2] == pytest.approx(3)


def test_a_recording_of_damaged_scans_alone_is_refused(tmp_path: Path) -> None:
    (tmp_path / "000000.pcd").write_bytes(b"no header")
    with pytest.raises(RecordingError, match="none of 1 scans can be read"):
        open_recording(tmp_path, skip_damaged=True)
