"""Gaussian processes: autoregressive over levels."""
