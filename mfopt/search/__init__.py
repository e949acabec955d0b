"""Ask and tell: the assisted search and its parts, planned CMA-ES."""
