"""Roads: outlines of what is paved, kerbs, markings, tram tracks and bridges."""
