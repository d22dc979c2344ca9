"""How the C library's allocator treats large arrays.

A frame's arrays are freed at its end, and glibc hands large ones back to the system at once. The next frame asks for the
same again, and pays for every page when it is first written to: at 1024 x 1024 a quarter of the time of building a cluster
hierarchy, and three quarters where its boxes have the full layout, 198 MB. So the process keeps what it has freed, as a
renderer keeps its buffers from frame to frame.
"""

from __future__ import annotations

import ctypes
import functools
import sys

_TRIM_THRESHOLD, _MMAP_MAX = -1, -4
"""Parameters of mallopt(3): bytes that may lie free, and arrays that are mapped, which is to say lent, one by one."""

KEPT = 1 << 30
"""Bytes that may lie free before memory goes back to the system."""


@functools.cache
def keep_freed_memory() -> bool:
    """Let this process reuse the pages of freed arrays; for all methods and peers alike.

    Returns
    -------
    True if the C library is glibc and took the order; elsewhere nothing changes but the time that it takes.
    """
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    return bool(mallopt and mallopt(_MMAP_MAX, 0) and mallopt(_TRIM_THRESHOLD, KEPT))
