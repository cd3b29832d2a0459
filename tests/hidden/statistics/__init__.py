"""Contracts of the statistics that the diagnosis core rests on, tested on synthetic scores."""
