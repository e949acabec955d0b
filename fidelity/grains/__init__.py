"""Grains: shape, loose and settled portions, filling of a vessel."""
