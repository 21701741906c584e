"""What the engine takes and gives: keyword arguments as its options, files, documents."""
