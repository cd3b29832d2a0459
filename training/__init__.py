"""Detectors trained and scored on KITTI-format drives."""
