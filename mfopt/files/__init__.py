"""Files that are whole or absent, arrays, locks, temporary folders."""
