"""Planes through the eye, all of a frustum's at once: LLVM vector code with an edge of the frustum per lane.

See `shadowbench.kernels.culling_planes` for what the planes are and why they reject no sample. The arithmetic is that of a
loop over the edges, operation by operation, so the bits are the same on every machine.
"""

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from shadowbench.kernels.culling_planes import ROUNDING, SLACK, UNUSED
from shadowbench.kernels.lanes import A_WEIGHT, B_WEIGHT, D_WEIGHT, N_EYE_PLANES

N_LANES = 8
"""Edges that are computed together; `N_EYE_PLANES` of them at most are used."""

_DOUBLE, _FLOAT, _INT32, _INT64 = ir.DoubleType(), ir.FloatType(), ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, N_LANES)


class _Lanes:
    """A vector of float64 with the operators that the formulas need."""

    def __init__(self, builder, value):
        self.builder, self.value = builder, value

    def __add__(self, other):
        return _Lanes(self.builder, self.builder.fadd(self.value, other.value))

    def __sub__(self, other):
        return _Lanes(self.builder, self.builder.fsub(self.value, other.value))

    def __mul__(self, other):
        return _Lanes(self.builder, self.builder.fmul(self.value, other.value))

    def __truediv__(self, other):
        return _Lanes(self.builder, self.builder.fdiv(self.value, other.value))

    def compare(self, comparison, other):
        """Conditions per lane; False where a value is not a number."""
        return self.builder.fcmp_ordered(comparison, self.value, other.value)

    def choose(self, condition, other):
        """This where the condition is true, else the other."""
        return _Lanes(self.builder, self.builder.select(condition, self.value, other.value))

    def negative(self):
        return _Lanes(self.builder, self.builder.fneg(self.value))

    def magnitude(self):
        return self.choose(self.compare(">=", _constant(self.builder, 0.0)), self.negative())


def _constant(builder, number):
    return _Lanes(builder, ir.Constant(_VECTOR, [number] * N_LANES))


def _splat(builder, scalar):
    vector = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), scalar, ir.Constant(_INT32, 0))
    return _Lanes(builder, builder.shuffle_vector(vector, vector,
                                                  ir.Constant(ir.VectorType(_INT32, N_LANES), [0] * N_LANES)))


def _gather(builder, data, indices):
    """Load three coordinates per lane from rows of an (n, 3) array."""
    vectors = []
    for j in range(3):
        vector = ir.Constant(_VECTOR, ir.Undefined)
        for lane, index in enumerate(indices):
            place = builder.add(builder.mul(index, ir.Constant(_INT64, 3)), ir.Constant(_INT64, j))
            vector = builder.insert_element(vector, builder.load(builder.gep(data, [place])), ir.Constant(_INT32, lane))
        vectors.append(_Lanes(builder, vector))
    return vectors


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _bounding_planes(builder, g, h, generators, growth, axes, reach):
    """Scaled rows a, b, d of the planes through the eye and two directions, and where they bound the frustum."""
    zero, m = _constant(builder, 0.0), _cross(g, h)
    low = high = zero
    for generator in generators:
        value = _dot(m, generator)
        low, high = value.choose(value.compare("<", low), low), value.choose(value.compare(">", high), high)
    a, b, d = (_dot(m, axis) for axis in axes)
    weight = (_constant(builder, A_WEIGHT) * a.magnitude() * reach[0]
              + _constant(builder, B_WEIGHT) * b.magnitude() * reach[1] + _constant(builder, D_WEIGHT) * d.magnitude())
    limit = (_constant(builder, SLACK) * weight / growth
             - _constant(builder, ROUNDING) * (m[0].magnitude() + m[1].magnitude() + m[2].magnitude()))
    below, above = high.compare("<=", limit), low.compare(">=", limit.negative())
    one = _constant(builder, 1.0)
    scale = one.choose(below, one.negative()) / weight
    bounds = builder.and_(builder.or_(below, above), weight.compare(">", zero))
    return (a * scale, b * scale, d * scale - _constant(builder, SLACK)), bounds


@intrinsic(prefer_literal=True)
def store_eye_planes(typing_context, rows, first, directions, starts, alongs, n_edges, n_generators, growth, axes, reach):
    """Write the rows of the planes through the eye and some edges of a frustum; `UNUSED` for those left over.

    Parameters
    ----------
    rows : float32 array, of rows (a, b, c, d); first : number of the first of the `N_EYE_PLANES` rows.
    directions : float64 (n, 3), seen from the eye; the first ones are unit vectors whose cone encloses the frustum.
    starts, alongs : int64 (8 or more,), the two directions of each edge; any valid numbers beyond the last.
    n_edges : number of edges, of which the first `N_EYE_PLANES` count; n_generators : number of unit vectors, a literal.
    growth : from `culling_planes.tolerance_growth`.
    axes : right, up and forward of the camera; reach : of the samples.
    """
    if not isinstance(n_generators, types.IntegerLiteral):
        return None
    count = n_generators.literal_value

    def codegen(context, builder, signature, args):
        rows, first, directions, starts, alongs, n_edges, _, growth, axes, reach = args
        arrays = {name: context.make_array(signature.args[i])(context, builder, value).data
                  for i, name, value in ((0, "rows", rows), (2, "directions", directions), (3, "starts", starts),
                                         (4, "alongs", alongs))}
        g, h = (_gather(builder, arrays["directions"],
                        [builder.load(builder.gep(arrays[name], [ir.Constant(_INT64, lane)])) for lane in range(N_LANES)])
                for name in ("starts", "alongs"))
        generators = [[_splat(builder, builder.load(builder.gep(arrays["directions"], [ir.Constant(_INT64, 3 * i + j)])))
                       for j in range(3)] for i in range(count)]
        axes = [[_splat(builder, builder.extract_value(axes, [i, j])) for j in range(3)] for i in range(3)]
        reach = [_splat(builder, builder.extract_value(reach, [i])) for i in range(3)]
        (a, b, d), bounds = _bounding_planes(builder, g, h, generators, _splat(builder, growth), axes, reach)
        lanes = ir.Constant(ir.VectorType(_INT64, N_LANES), list(range(N_LANES)))
        number = builder.insert_element(ir.Constant(lanes.type, ir.Undefined), n_edges, ir.Constant(_INT32, 0))
        number = builder.shuffle_vector(number, number, ir.Constant(ir.VectorType(_INT32, N_LANES), [0] * N_LANES))
        bounds = builder.and_(bounds, builder.icmp_signed("<", lanes, number))
        narrow = ir.VectorType(_FLOAT, N_LANES)
        values = [builder.select(bounds, builder.fptrunc(value.value, narrow), ir.Constant(narrow, [unused] * N_LANES))
                  for value, unused in ((a, UNUSED[0]), (b, UNUSED[1]), (_constant(builder, 0.0), UNUSED[2]),
                                        (d, UNUSED[3]))]
        for row in range(N_EYE_PLANES):
            place = builder.mul(builder.add(first, ir.Constant(_INT64, row)), ir.Constant(_INT64, 4))
            for j, value in enumerate(values):
                element = builder.extract_element(value, ir.Constant(_INT32, row))
                builder.store(element, builder.gep(arrays["rows"], [builder.add(place, ir.Constant(_INT64, j))]))
        return context.get_dummy_value()

    vector = types.UniTuple(types.float64, 3)
    return types.void(rows, types.int64, directions, starts, alongs, types.int64, n_generators, types.float64,
                      types.UniTuple(vector, 3), vector), codegen
