"""Recordings of experiments, and simulations fitted to them."""
