"""Recordings, parameter fits and missing physics; empty so far."""
