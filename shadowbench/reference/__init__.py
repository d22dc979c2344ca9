"""The certified reference: independent of every algorithm that it judges.

It shares no kernel with them. `certified.certified_shadows` is the entry point; `predicates` holds the
error-bounded float64 tests and their proof, `exact` the rational arithmetic behind them, `light_space`,
`light_tree`, `frusta`, `face_planes` and `traversal` the acceleration. `transparent.certified_transmittance` is its
counterpart for casters that let light through, on top of the lists that `crossings` makes.
"""

from shadowbench.reference.certified import ReferenceResult, Statistics, bias_floor, certified_shadows
from shadowbench.reference.transparent import TransparentResult, certified_transmittance

__all__ = ["ReferenceResult", "Statistics", "TransparentResult", "bias_floor", "certified_shadows",
           "certified_transmittance"]
