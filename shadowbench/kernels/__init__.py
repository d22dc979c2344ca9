"""Jitted building blocks used by two or more algorithms: arrays in, arrays out, no input or output."""
