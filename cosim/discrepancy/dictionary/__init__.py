"""Hypotheses about what a model lacks: channels × covariates, tangents of catalogue effects, shared errors."""
