"""Fault injection: what can go wrong is made to go wrong, and what became of the run is told.

One file a kind of fault; each has a function `trial(base, seed, number)` that makes one fault and
returns what happened. `python -m faults` and the tests of this folder run the same trials.
"""
