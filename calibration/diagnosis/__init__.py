"""What a simulation lacks: is there a mismatch, where, which effect explains it."""
