"""Calibrations to real recordings, which are no part of this repository."""
