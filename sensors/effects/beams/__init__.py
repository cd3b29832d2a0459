"""Where beams leave from, whither and when."""
