"""Fitted models, and what they answer."""
