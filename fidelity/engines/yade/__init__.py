"""YADE, the reference engine, in a process of its own."""
