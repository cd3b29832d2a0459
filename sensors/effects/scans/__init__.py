"""Points that are added, taken away or moved together."""
