"""A study file or a call of `minimize`, made ready to run."""
