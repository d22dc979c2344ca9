"""Compares two runs: operation counts, times with their spread, accuracy, pictures."""
