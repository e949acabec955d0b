"""Gaussian processes over levels and over time series; empty so far."""
