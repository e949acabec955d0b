"""Discharge of a hopper through an outlet."""
