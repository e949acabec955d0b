"""The loop that runs what is asked: check, phases, executors, store, resume."""
