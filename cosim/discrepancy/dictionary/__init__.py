"""Hypotheses about missing effects: channels × covariates, tangents of catalogue effects, shared errors."""
