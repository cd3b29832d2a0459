"""Recordings: a folder of scans, a bag or a capture, without labels and without a world."""

from cosim.recordings.recording import Recording, open_recording
from cosim.recordings.scan import RecordingError, Scan

__all__ = ["Recording", "RecordingError", "Scan", "open_recording"]
