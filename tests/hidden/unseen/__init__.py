"""Makers of effects that no catalogue lists; each draws its parameters from a seed."""
