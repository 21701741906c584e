"""What all rooms use: numbers, clocks and columns as arrays of NumPy, warnings, small pictures. It needs no engine."""
