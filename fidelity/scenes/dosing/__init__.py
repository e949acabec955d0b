"""The dosing machine: a cup that moves over a hopper."""
