"""Methods whose tests can be listed one by one."""

from __future__ import annotations

WALKS = {"ptsv": "tile_walk", "cluster": "cluster_walk", "ray_traced": "ray_walk", "z_pass": "stencil_walk",
         "z_fail": "stencil_walk"}
"""Modules of the methods whose tests can be listed."""

BY_TRIANGLE = ("ptsv", "cluster", "z_pass", "z_fail")
"""Methods that book tests on triangles; a ray tracer books them on rays alone."""


def refusal(algorithm: str, group: int, by_triangle: bool) -> str | None:
    """Say why a method's tests can't be listed, and what to do; None if they can.

    Parameters
    ----------
    group : triangles that share a bounding frustum, 1 for methods without groups.
    by_triangle : True for the tests of a triangle, False for those of a pixel.
    """
    known = BY_TRIANGLE if by_triangle else tuple(WALKS)
    if algorithm not in known:
        return (f"{algorithm} has no trace {'by triangle ' if by_triangle else ''}that could be listed: "
                f"choose from {', '.join(known)}")
    if group != 1:
        return (f"{algorithm} with group={group} can't be listed: groups share their tests; "
                "explain it with group=1")
    return None
