"""The gate on operation counts: a suite of small scenes, a committed baseline, and what differs between the two."""
