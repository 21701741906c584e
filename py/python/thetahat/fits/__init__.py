"""Fits: from logs to models; of one log, of many, and several models side by side."""
