"""Errors of annotators."""
