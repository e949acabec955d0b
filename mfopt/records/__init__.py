"""What travels through a study: problem, candidate, outcome, evaluation, level, objective."""
