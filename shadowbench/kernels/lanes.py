"""Vector lanes: boxes and samples tested against planes in groups of eight, as LLVM vector code.

A plain loop over the children of a node does not vectorise. These intrinsics emit ``<8 x float>`` arithmetic, a
compare and a bit cast of the result to a mask, which is the papers' ballot. They use + * and comparisons alone, so
a machine without such registers splits the vectors and gets the same bits.

**Planes.** A row (a, b, c, d) is evaluated as ``(a x + (b y + d)) + c r``; positive is outside. Rows are scaled so
that ``A_WEIGHT |a| X + B_WEIGHT |b| Y + C_WEIGHT |c| R + D_WEIGHT |d| = 1``, where X, Y and R bound the magnitudes
of the coordinates. Then the float32 value of a float32 row at float32 coordinates is within `UNDECIDED` of the
exact value of the exact row at the exact coordinates: the weights count the roundings that each term passes through
(coefficient, coordinate, product, sums; the coordinate r is a rounded quotient of a rounded depth, one more).

**Boxes hold the float32 coordinates of their samples.** Rounding is monotone, so evaluated by the same operations
in the same order a row's value at the reject corner is at most its value at any sample of the box, and at the accept
corner at least. Whatever a box's test decides beyond `UNDECIDED`, the test of each of its samples would have decided:
boxes need no margin.

**Layout.** Tests take a record with the array ``rows`` and the place of the first row, a record with the arrays
``x``, ``y`` and ``r``, the number of chunks of a group, and the places of its coordinates in the arrays. A chunk has
`LANES` lanes. Coordinates y and r hold one value per lane; a box's largest values follow its smallest
ones, ``n_chunks * LANES`` further on. With ``x_step = LANES`` so does x; with ``x_step = 0`` all chunks share `LANES`
values of x, and the largest ones follow `LANES` further on.
"""

import struct
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

LANES = 8
"""Values per vector."""

N_EYE_PLANES, N_WEDGE_PLANES, N_FRUSTUM_PLANES, N_GROUP_PLANES = 6, 3, 4, 5
"""Rows of each kind that are tested together."""

A_WEIGHT, B_WEIGHT, C_WEIGHT, D_WEIGHT = 5.0, 6.0, 5.0, 4.0
"""Roundings that the terms a x, b y, c r and d of a row pass through."""

UNDECIDED = 6.0e-8
"""Largest float32 error of a scaled row: 2^-24 = 5.97e-8 per rounding, plus 0.6 % for products of roundings."""

_FLOAT, _INT8, _INT32, _INT64 = ir.FloatType(), ir.IntType(8), ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(_FLOAT, LANES)


def _int64(value):
    return ir.Constant(_INT64, value)


def _splat(builder, scalar):
    """Copy a scalar to every lane."""
    empty = ir.Constant(_VECTOR, ir.Undefined)
    vector = builder.insert_element(empty, scalar, ir.Constant(_INT32, 0))
    return builder.shuffle_vector(vector, empty, ir.Constant(ir.VectorType(_INT32, LANES), [0] * LANES))


def _load(builder, data, offset):
    """Load a vector that need not be aligned."""
    vector = builder.load(builder.bitcast(builder.gep(data, [offset]), _VECTOR.as_pointer()))
    vector.align = 4
    return vector


def _larger(builder, a, b):
    """Lane by lane, the larger of two vectors; `a` may be None."""
    return b if a is None else builder.select(builder.fcmp_ordered(">", b, a), b, a)


class _Rows:
    """The coefficients of consecutive plane rows, and the corner of a box that each sign picks."""

    def __init__(self, builder, data, first, n_rows, n_coordinates):
        self.builder, self.n_coordinates = builder, n_coordinates
        pointers = [[builder.gep(data, [builder.add(first, _int64(4 * row + j))]) for j in range(4)]
                    for row in range(n_rows)]
        self.coefficients = [[_splat(builder, builder.load(p)) for p in row] for row in pointers]
        self.signs = [[self._sign(p) for p in row[:n_coordinates]] for row in pointers]

    def _sign(self, pointer):
        """All ones for a negative coefficient, else zero."""
        bits = self.builder.load(self.builder.bitcast(pointer, _INT32.as_pointer()))
        return self.builder.sext(self.builder.ashr(bits, ir.Constant(_INT32, 31)), _INT64)

    def corner(self, row, j, accept, stride):
        """Offset of the coordinate that makes the row's value smallest (reject) or largest (accept)."""
        sign = self.builder.not_(self.signs[row][j]) if accept else self.signs[row][j]
        return self.builder.and_(sign, stride)

    def value(self, row, coordinates):
        """The row's value at vectors of coordinates, in the documented order."""
        b, (cx, cy, cr, d) = self.builder, self.coefficients[row]
        value = b.fadd(b.fmul(cx, coordinates[0]), b.fadd(b.fmul(cy, coordinates[1]), d))
        return value if self.n_coordinates == 2 else b.fadd(value, b.fmul(cr, coordinates[2]))


def _array(context, builder, record, value, field):
    """Data pointer of an array in a record. Taken here, it costs no reference count, unlike in a kernel."""
    index = record.fields.index(field)
    return context.make_array(record.types[index])(context, builder, builder.extract_value(value, index)).data


class _Axis(NamedTuple):
    """Where one coordinate of a group lies: stride from smallest to largest values, step from chunk to chunk."""

    data: Any
    offset: Any
    stride: Any
    step: Any


def _largest(builder, rows, axes, chunk, accept):
    """Largest value over all rows, lane by lane, at the reject (False) or accept (True) corner or at samples (None)."""
    largest = None
    for row in range(len(rows.coefficients)):
        coordinates = []
        for j, axis in enumerate(axes):
            offset = axis.offset
            if accept is not None:
                offset = builder.add(offset, rows.corner(row, j, accept, axis.stride))
            coordinates.append(_load(builder, axis.data, builder.add(offset, builder.mul(chunk, axis.step))))
        largest = _larger(builder, largest, rows.value(row, coordinates))
    return largest


def _for_chunks(builder, n_chunks, alive, n_masks, body):
    """Run `body(index)`, which returns conditions, on the chunks that have a lane alive; return a mask of each."""
    masks = [cgutils.alloca_once_value(builder, _int64(0)) for _ in range(n_masks)]
    with cgutils.for_range(builder, n_chunks, intp=_INT64) as loop:
        shift = builder.mul(loop.index, _int64(LANES))
        here = builder.trunc(builder.lshr(alive, shift), _INT8)
        with builder.if_then(builder.icmp_unsigned("!=", here, ir.Constant(_INT8, 0))):
            for mask, condition in zip(masks, body(loop.index), strict=True):
                bits = builder.zext(builder.bitcast(condition, _INT8), _INT64)
                builder.store(builder.or_(builder.load(mask), builder.shl(bits, shift)), mask)
    return [builder.load(mask) for mask in masks]


def _make_test(n_rows, n_coordinates, corners, conditions):
    """Make the intrinsic that tests a group against `n_rows` rows.

    Parameters
    ----------
    corners : for each value that is needed, False for the reject corner, True for the accept corner, or None for
        samples, whose smallest and largest coordinates are one.
    conditions : (comparison, threshold, index into `corners`) of each mask that is returned.
    """
    returned = types.UniTuple(types.uint64, len(conditions)) if len(conditions) > 1 else types.uint64

    @intrinsic
    def test_group(typing_context, planes, row, boxes, n_chunks, x0, x_step, y0, r0, alive):
        signature = returned(planes, types.int64, boxes, *[types.int64] * 5, types.uint64)

        def codegen(context, builder, signature, args):
            planes, row, boxes, n_chunks, x0, x_step, y0, r0, alive = args
            rows = _array(context, builder, signature.args[0], planes, "rows")
            x, y, r = (_array(context, builder, signature.args[2], boxes, name) for name in "xyr")
            plane_rows = _Rows(builder, rows, row, n_rows, n_coordinates)
            lanes = builder.mul(n_chunks, _int64(LANES))
            shared = builder.icmp_signed("==", x_step, _int64(0))
            axes = [_Axis(x, x0, builder.select(shared, _int64(LANES), lanes), x_step),
                    _Axis(y, y0, lanes, _int64(LANES)), _Axis(r, r0, lanes, _int64(LANES))][:n_coordinates]
            compare = [(c, _splat(builder, ir.Constant(_FLOAT, float32(t))), v) for c, t, v in conditions]

            def body(chunk):
                values = [_largest(builder, plane_rows, axes, chunk, accept) for accept in corners]
                return [builder.fcmp_ordered(c, values[v], limit) for c, limit, v in compare]

            masks = _for_chunks(builder, n_chunks, alive, len(conditions), body)
            return context.make_tuple(builder, signature.return_type, masks) if len(masks) > 1 else masks[0]

        return signature, codegen

    return test_group


def float32(value):
    """Round to the nearest float32, as a Python float."""
    return struct.unpack("f", struct.pack("f", value))[0]


_OUTSIDE = (">", UNDECIDED, 0)

outside_eye_planes = _make_test(N_EYE_PLANES, 2, (False,), (_OUTSIDE,))
"""Mask of the boxes that lie outside one of the planes through the eye (their c is 0: r is not read)."""

outside_wedge_planes = _make_test(N_WEDGE_PLANES, 3, (False,), (_OUTSIDE,))
"""Mask of the boxes that lie outside one of the wedge planes."""

outside_group_planes = _make_test(N_GROUP_PLANES, 3, (False,), (_OUTSIDE,))
"""Mask of the boxes that lie outside one side or the cap plane of a group's bounding frustum."""

classify_boxes = _make_test(N_FRUSTUM_PLANES, 3, (False, True), (_OUTSIDE, (">=", -UNDECIDED, 1)))
"""Masks of the boxes that lie outside one frustum plane, and of those not certainly inside all of them."""

classify_samples = _make_test(N_FRUSTUM_PLANES, 3, (None,), (_OUTSIDE, (">=", -UNDECIDED, 0)))
"""Masks of the samples that lie outside one frustum plane, and of those not certainly inside all of them."""


@intrinsic
def lowest_bit(typing_context, mask):
    """Index of the lowest bit set in a mask that is not zero."""
    def codegen(context, builder, signature, args):
        return builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))

    return types.int64(types.uint64), codegen


@intrinsic
def count_bits(typing_context, mask):
    """Number of bits set in a mask."""
    def codegen(context, builder, signature, args):
        return builder.ctpop(args[0])

    return types.int64(types.uint64), codegen
