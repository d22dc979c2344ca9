"""The definition of "in shadow", word for word, in rational arithmetic. Slow and obvious: the oracle of other
tests."""

from fractions import Fraction
from typing import NamedTuple


class Flags(NamedTuple):
    """What the definition says about one sample and one triangle, or about a sample and the union of
    triangles."""

    shadowed: bool = False
    planes_out: bool = False
    planes_in: bool = False
    bias_floor: bool = False
    bias_doubled: bool = False

    @property
    def ambiguous(self):
        if self.shadowed:
            return not (self.planes_in and self.bias_doubled)
        return self.planes_out or self.bias_floor


def rational(vector):
    return [Fraction(float(component)) for component in vector]


def minus(x, y):
    return [a - b for a, b in zip(x, y, strict=True)]


def cross(x, y):
    return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]


def dot(x, y):
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


def sign(x):
    return (x > 0) - (x < 0)


def exceeds(x, distance, squared_length, *, or_equal=False):
    """Compare x with distance * sqrt(squared_length), where the distance may be negative."""
    left, right = sign(x) * x * x, sign(distance) * distance * distance * squared_length
    return left >= right if or_equal else left > right


def side_plane(u, v, light):
    """Normal m of the plane through the light and the edge (u, v); f(p) = m . (p - u)."""
    if light[3] == 0:
        return cross(minus(v, u), light[:3])
    return cross(minus(u, light[:3]), minus(v, light[:3]))


def pair_flags(triangle, light, p, bias, tie, floor):
    """Evaluate the definition for one triangle (3 x 3), light (4), sample (3) and distances."""
    a, b, c = (rational(vertex) for vertex in triangle)
    light, p = rational(light), rational(p)
    bias, tie, floor = Fraction(float(bias)), Fraction(float(tie)), Fraction(float(floor))
    n = cross(minus(b, a), minus(c, a))
    s = sign(dot(n, minus(light[:3], [light[3] * x for x in a])))
    if s == 0:
        return Flags()
    t = -s * dot(n, minus(p, a))
    behind, behind_floor, behind_doubled = (exceeds(t, d, dot(n, n)) for d in (bias, floor, 2 * bias))
    inside, inside_out, inside_in = True, True, True
    for u, v, opposite in ((a, b, c), (b, c, a), (c, a, b)):
        m = side_plane(u, v, light)
        f = sign(dot(m, minus(opposite, u))) * dot(m, minus(p, u))
        inside = inside and f >= 0
        inside_out = inside_out and exceeds(f, -tie, dot(m, m), or_equal=True)
        inside_in = inside_in and exceeds(f, tie, dot(m, m), or_equal=True)
    return Flags(inside and behind, inside_out and behind, inside_in and behind, inside and behind_floor,
                 inside and behind_doubled)


def rounding_floor(corners, positions, bias):
    """64 unit roundoffs of the largest coordinate, but no more than the bias."""
    coordinates = [abs(float(x)) for triangle in corners for vertex in triangle for x in vertex]
    coordinates += [abs(float(x)) for p in positions for x in p]
    return min(64 * 2.0**-53 * max(coordinates, default=0.0), float(bias))


def sample_flags(corners, light, positions, bias, ties, casters=None):
    """Flags of each sample over the union of all triangles that cast."""
    floor = rounding_floor(corners, positions, bias)
    results = []
    for p, tie in zip(positions, ties, strict=True):
        pairs = [pair_flags(triangle, light, p, bias, tie, floor) for k, triangle in enumerate(corners)
                 if casters is None or casters[k]]
        results.append(Flags(*(any(pair[k] for pair in pairs) for k in range(5))))
    return results
