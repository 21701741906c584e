"""Logs: the measured signals, how they are read, and their checks before a fit."""
