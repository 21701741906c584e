"""What follows a log row by row: states of models, and models that are estimated."""
