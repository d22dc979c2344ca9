"""A reference testbed for hard shadows: certified truth, exact operation counts, timings and pictures."""

__version__ = "0.1.0"
