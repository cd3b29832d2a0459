"""Compare with measurements, find the missing effect, add it, watch the error fall."""
