"""Rows of eight samples as LLVM vectors: masks of those included or in a range of depth, their 1 / depth; bounds of tiles.

As in `shadowbench.kernels.lanes` only single IEEE operations and comparisons are used, the same bits on every machine.
"""

from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from shadowbench.kernels.lanes import LANES

_FLOAT, _DOUBLE = ir.FloatType(), ir.DoubleType()
_INT8, _INT32, _INT64 = ir.IntType(8), ir.IntType(32), ir.IntType(64)


def _pointer(context, builder, array_type, array, index, element):
    """Pointer to a row of eight elements of an array, from the index of the first one."""
    data = context.make_array(array_type)(context, builder, array).data
    vector = ir.VectorType(element, LANES).as_pointer()
    return builder.bitcast(builder.gep(data, [index]), vector)


def _load(builder, pointer, align):
    row = builder.load(pointer)
    row.align = align
    return row


def _splat(builder, scalar):
    vector_type = ir.VectorType(scalar.type, LANES)
    vector = builder.insert_element(ir.Constant(vector_type, ir.Undefined), scalar, ir.Constant(_INT32, 0))
    return builder.shuffle_vector(vector, vector, ir.Constant(ir.VectorType(_INT32, LANES), [0] * LANES))


def _flags(builder, mask):
    """The lowest eight bits of a mask as a vector of conditions."""
    return builder.bitcast(builder.trunc(mask, _INT8), ir.VectorType(ir.IntType(1), LANES))


@intrinsic
def row_mask(typing_context, flags, first):
    """Mask of the True ones among eight elements of a bool array."""
    def codegen(context, builder, signature, args):
        row = _load(builder, _pointer(context, builder, signature.args[0], *args, _INT8), 1)
        found = builder.icmp_unsigned("!=", row, ir.Constant(row.type, [0] * LANES))
        return builder.zext(builder.bitcast(found, _INT8), _INT64)

    return types.uint64(flags, types.int64), codegen


@intrinsic
def row_between(typing_context, values, first, low, high):
    """Mask of those among eight float64 values that are not below `low` and not at or above `high`."""
    def codegen(context, builder, signature, args):
        row = _load(builder, _pointer(context, builder, signature.args[0], args[0], args[1], _DOUBLE), 8)
        reaches = builder.fcmp_unordered(">=", row, _splat(builder, args[2]))
        ends = builder.fcmp_ordered(">=", row, _splat(builder, args[3]))
        found = builder.and_(reaches, builder.not_(ends))
        return builder.zext(builder.bitcast(found, _INT8), _INT64)

    return types.uint64(values, types.int64, types.float64, types.float64), codegen


@intrinsic
def store_reciprocals(typing_context, depth, first, mask, r, place):
    """Write 1 / depth of the samples of a mask, in float32 from the float32 depth; 0 for the others of the eight."""
    def codegen(context, builder, signature, args):
        depth, first, mask, r, place = args
        row = _load(builder, _pointer(context, builder, signature.args[0], depth, first, _DOUBLE), 8)
        rounded = builder.fptrunc(row, ir.VectorType(_FLOAT, LANES))
        quotient = builder.fdiv(ir.Constant(rounded.type, [1.0] * LANES), rounded)
        chosen = builder.select(_flags(builder, mask), quotient, ir.Constant(rounded.type, [0.0] * LANES))
        stored = builder.store(chosen, _pointer(context, builder, signature.args[3], r, place, _FLOAT))
        stored.align = 4
        return context.get_dummy_value()

    return types.void(depth, types.int64, types.uint64, r, types.int64), codegen


@intrinsic
def masked_bounds(typing_context, values, first, mask, n_chunks):
    """Smallest and largest of those among some chunks of eight float32 values that a mask, which is not zero, has."""
    def codegen(context, builder, signature, args):
        values, first, mask, n_chunks = args
        limits = [ir.Constant(ir.VectorType(_FLOAT, LANES), [limit] * LANES) for limit in (float("inf"), float("-inf"))]
        comparisons, places = ("<", ">"), [cgutils.alloca_once_value(builder, limit) for limit in limits]
        with cgutils.for_range(builder, n_chunks, intp=_INT64) as loop:
            offset = builder.mul(loop.index, ir.Constant(_INT64, LANES))
            pointer = _pointer(context, builder, signature.args[0], values, builder.add(first, offset), _FLOAT)
            here, flags = _load(builder, pointer, 4), _flags(builder, builder.lshr(mask, offset))
            for i, comparison in enumerate(comparisons):
                chosen, so_far = builder.select(flags, here, limits[i]), builder.load(places[i])
                better = builder.fcmp_ordered(comparison, chosen, so_far)
                builder.store(builder.select(better, chosen, so_far), places[i])
        best = [builder.load(place) for place in places]
        for step in (4, 2, 1):
            turned = ir.Constant(ir.VectorType(_INT32, LANES), [(i + step) % LANES for i in range(LANES)])
            for i, comparison in enumerate(comparisons):
                other = builder.shuffle_vector(best[i], best[i], turned)
                best[i] = builder.select(builder.fcmp_ordered(comparison, other, best[i]), other, best[i])
        return context.make_tuple(builder, signature.return_type,
                                  [builder.extract_element(vector, ir.Constant(_INT32, 0)) for vector in best])

    return types.UniTuple(types.float32, 2)(values, types.int64, types.uint64, types.int64), codegen


@intrinsic
def highest_bit(typing_context, mask):
    """Index of the highest bit set in a mask that is not zero."""
    def codegen(context, builder, signature, args):
        zeros = builder.ctlz(args[0], ir.Constant(ir.IntType(1), 1))
        return builder.sub(ir.Constant(_INT64, 63), zeros)

    return types.int64(types.uint64), codegen
