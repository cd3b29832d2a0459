"""Captures of UDP packets (`.pcap`): Velodyne's through velodyne-decoder, Ouster's through Ouster's SDK.

Sensors are distinguished by the first bytes of their data packets: Velodyne VLP-16 user manual (63-9243), section 9.3;
Hesai Pandar and XT user manuals, section "Point cloud data packet"; RoboSense rslidar_sdk, MSOP packets.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from cosim.point_files import Columns
from cosim.recordings.libraries import needed
from cosim.recordings.reading.ouster import ouster_sources
from cosim.recordings.reading.source import Source, capture_sources
from cosim.recordings.scan import RecordingError

PACKET_SUFFIXES = (".pcap", ".pcapng", ".osf")
_PACKETS = 500  # that are looked at to find the vendor
_VELODYNE_BYTES = 1206
_VELODYNE, _HESAI_40 = b"\xff\xee", (1262, 1266)  # the first block's flag, also of Hesai's Pandar40 with longer packets
_HESAI, _ROBOSENSE = b"\xee\xff", (b"\x55\xaa\x05\x0a", b"\x55\xaa\x05\x5a", b"\x55\xaa\x5a\xa5")
_CONVERTERS = {
    "Hesai": "Hesai's driver (HesaiTechnology/HesaiLidar_ROS_2.0) or tier4/nebula, and record its PointCloud2",
    "RoboSense": "RoboSense's driver (RoboSense-LiDAR/rslidar_sdk), and record its PointCloud2",
}


def packet_sources(path: Path) -> tuple[Source, ...]:
    """Scans of a capture, in order.

    Raises:
        RecordingError: packets of a sensor for which there is no reader, or a damaged capture.
    """
    if path.suffix.lower() == ".osf":
        return ouster_sources(path)
    vendor = _vendor(path)
    if vendor in _CONVERTERS:
        raise RecordingError(
            f"{path}: packets of a {vendor} sensor, which cannot be read here; play them through {_CONVERTERS[vendor]}"
        )
    return capture_sources(path, _velodyne_scans, _velodyne_columns) if vendor == "Velodyne" else ouster_sources(path)


def _vendor(path: Path) -> str | None:
    """Whose data packets most of the first packets are; None if unknown, as Ouster's, which have no common flag."""
    dpkt = needed("dpkt", f"{path.name} (packets)")
    try:
        with path.open("rb") as file:
            found = Counter(map(_vendor_of, islice(_payloads(dpkt, file), _PACKETS)))
    except (ValueError, dpkt.dpkt.Error) as error:
        raise RecordingError(f"{path}: not a readable capture ({error}); record or copy it again") from None
    if not found:
        raise RecordingError(f"{path}: no UDP packets in it; record the sensor's data port")
    del found[None]
    return found.most_common(1)[0][0] if found else None


def _payloads(dpkt: Any, file: Any) -> Iterator[bytes]:
    """Contents of the UDP packets of a capture."""
    for _, frame in dpkt.pcap.UniversalReader(file):
        try:
            layer = dpkt.ethernet.Ethernet(frame)
        except dpkt.dpkt.UnpackError:
            continue
        while hasattr(layer, "data") and not isinstance(layer, dpkt.udp.UDP):
            layer = layer.data
        if isinstance(layer, dpkt.udp.UDP):
            yield bytes(layer.data)


def _vendor_of(payload: bytes) -> str | None:
    if payload[:2] == _HESAI or (payload[:2] == _VELODYNE and len(payload) in _HESAI_40):
        return "Hesai"
    if payload[:2] == _VELODYNE and len(payload) == _VELODYNE_BYTES:
        return "Velodyne"
    return "RoboSense" if payload[:4] in _ROBOSENSE else None


def _velodyne_scans(path: Path) -> Iterator[tuple[float, Any]]:
    """Time stamps [s] and points of the scans of a capture, in order."""
    decoder = needed("velodyne_decoder", f"{path.name} (Velodyne)")
    try:
        for stamp, points in decoder.read_pcap(str(path), as_pcl_structs=True):
            yield float(stamp.host), points
    except Exception as error:  # noqa: BLE001 - the decoder raises whatever it meets
        reason = " ".join(str(error).split())[:200]
        raise RecordingError(
            f"{path}: velodyne-decoder cannot read it ({reason}); copy it again, save it as .pcap (editcap -F pcap), "
            "or play it through Velodyne's driver and record its PointCloud2"
        ) from None


def _velodyne_columns(points: Any) -> Columns:
    return {name: points[name] for name in points.dtype.names}
