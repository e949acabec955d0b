"""The commands of the `mfopt` program, a file each: here core and sibling folders meet."""
