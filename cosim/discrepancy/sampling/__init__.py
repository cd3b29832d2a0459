"""Samples of a drive's beams: sampling, measurements, derivatives and groups."""
