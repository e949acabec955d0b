"""Grain engines: each moves what a setup describes."""
