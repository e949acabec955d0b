"""Levels of simulation: scenes on grain engines, and the analytic model."""
