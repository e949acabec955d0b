"""Recordings of experiments: a folder of CSV files and a `case.toml`, read and checked."""
