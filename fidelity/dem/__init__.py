"""The project's own discrete-element kernel, compiled by Numba."""
