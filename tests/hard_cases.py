"""The hard cases of the conformance suite, under the name that the tests use."""

from shadowbench.conformance.cases import HARD_CASES, Case, box, ground, mesh_of, soup

__all__ = ["HARD_CASES", "Case", "box", "ground", "mesh_of", "soup"]
