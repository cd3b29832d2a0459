"""Captures of packets: Velodyne's are read, of others the message names the converter."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from cosim.recordings import RecordingError, open_recording
from cosim.recordings.pattern.find import find_pattern

pytest.importorskip("dpkt")
ELEVATIONS_DEG = (-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15)  # VLP-16 user manual, table 9-1
STEP_CDEG = 20  # of the head from firing to firing [0.01°]
FIRING_S = 55.296e-6


def write_capture(file: Path, payloads: list[bytes], port: int = 2368) -> None:
    """A capture of UDP packets on Ethernet, a millisecond apart (libpcap's file format)."""
    content = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    for number, payload in enumerate(payloads):
        udp = struct.pack(">HHHH", port, port, 8 + len(payload), 0) + payload
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, b"\xc0\xa8\x01\xc9", b"\xff" * 4)
        frame = b"\xff" * 6 + b"\x60\x76\x88\x00\x00\x00" + b"\x08\x00" + ip + udp
        content += struct.pack("<IIII", 1000, 1327 * number % 1_000_000, len(frame), len(frame)) + frame
    file.write_bytes(content)


def vlp16_packets(turns: float) -> list[bytes]:
    """Packets of a VLP-16 in a square room: walls at 8 m, ground 1.8 m below (manual, section 9.3.1)."""
    elevation = np.radians(ELEVATIONS_DEG)
    ground = np.where(elevation < 0, 1.8 / np.maximum(-np.sin(elevation), 1e-9), np.inf)
    packets, firing = [], 0
    while firing < turns * 36_000 / STEP_CDEG:
        blocks = b""
        for _ in range(12):  # of two firings each
            blocks += b"\xff\xee" + struct.pack("<H", firing * STEP_CDEG % 36_000)
            for _ in range(2):
                azimuth = np.radians(firing * STEP_CDEG / 100)
                wall = 8 / max(abs(np.cos(azimuth)), abs(np.sin(azimuth))) / np.cos(elevation)
                for away in np.minimum(wall, ground):
                    blocks += struct.pack("<HB", round(float(away) / 0.002), 40)
                firing += 1
        packets.append(blocks + struct.pack("<IBB", round(firing * FIRING_S * 1e6), 0x37, 0x22))
    return packets


def test_a_velodyne_capture_gives_its_lasers(tmp_path: Path) -> None:
    pytest.importorskip("velodyne_decoder")
    file = tmp_path / "drive.pcap"
    write_capture(file, vlp16_packets(4.2))
    recording = open_recording(file)
    assert len(recording) >= 4
    again = recording[2].xyz
    assert len(recording[1]) == pytest.approx(len(again), rel=0.1)  # going back and forth
    np.testing.assert_array_equal(recording[2].xyz, again)
    scan = recording[2]
    assert scan.flat_range_m.max() == pytest.approx(8 * np.sqrt(2), abs=0.1)
    assert scan.xyz[:, 2].min() == pytest.approx(-1.8, abs=0.02)
    assert scan.ring is not None and scan.time_s is not None and scan.intensity is not None
    found = find_pattern(recording)
    np.testing.assert_allclose(found.lasers.elevation_deg, sorted(ELEVATIONS_DEG, reverse=True), atol=0.1)


@pytest.mark.parametrize(
    ("payload", "says"),
    [
        (b"\xee\xff\x06\x01" + bytes(1000), "packets of a Hesai sensor.*nebula"),
        ((b"\xff\xee" + bytes(122)) * 10 + bytes(22), "packets of a Hesai sensor"),
        (b"\x55\xaa\x05\x0a\x5a\xa5\x50\xa0" + bytes(1240), "packets of a RoboSense sensor.*rslidar_sdk"),
    ],
    ids=["hesai", "pandar40", "robosense"],
)
def test_captures_without_a_reader_name_the_converter(payload: bytes, says: str, tmp_path: Path) -> None:
    file = tmp_path / "drive.pcap"
    write_capture(file, [payload] * 3)
    with pytest.raises(RecordingError, match=says) as caught:
        open_recording(file)
    assert "\n" not in str(caught.value) and str(file) in str(caught.value)


def test_a_file_that_is_no_capture_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "drive.pcap"
    file.write_bytes(b"no packets at all, only text, and enough of it for a header")
    with pytest.raises(RecordingError, match="not a readable capture"):
        open_recording(file)
    write_capture(file, [])
    with pytest.raises(RecordingError, match="no UDP packets"):
        open_recording(file)
