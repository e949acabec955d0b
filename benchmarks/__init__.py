"""Measurements that back what the documentation says; the product imports nothing from here."""
