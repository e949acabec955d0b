"""Grain engines compared: agreement of what they tell, and speed."""
