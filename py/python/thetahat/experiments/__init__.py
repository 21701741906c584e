"""What experiments show without a fit, and test signals for them."""
