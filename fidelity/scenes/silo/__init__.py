"""A slender silo, and how much of the weight its walls carry."""
