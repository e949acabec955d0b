"""A heap left by a lifted cylinder."""
