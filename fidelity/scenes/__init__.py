"""Machines and tests that handle grains."""
