"""Searches compared: how much does it cost to reach a good design, and how surely?"""
