"""Logs: the measured signals, how they are read, and what they are worth before any fit."""
