"""Controllers for models and processes."""
