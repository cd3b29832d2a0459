"""Measured drives with hidden physics, made from a twin by a program that shares no code with the sensors."""
