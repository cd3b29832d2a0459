"""A twin of a recording: odometry, a map of surfels, what moves, held-out scans."""

from cosim.recordings.mapping.twin import RecordingTwin, write_recording_twin

__all__ = ["RecordingTwin", "write_recording_twin"]
