"""Fences, walls and hedges: around gardens and along open street fronts."""
