"""Likelihood, scores, random effects, fits, tests and intervals."""
