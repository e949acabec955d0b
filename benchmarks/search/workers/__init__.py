"""Methods with clashing dependencies, each importable only in its own environment."""
