"""How well calibration finds what is known, and how sure it is of that."""
