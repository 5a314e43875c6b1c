"""What the numbers of an action mean: specs, built-in layouts, encoding and decoding."""
