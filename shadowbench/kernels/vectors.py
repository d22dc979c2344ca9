"""Three-dimensional vectors as tuples of float64: plain + and * in source order, and no memory."""

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from shadowbench.jit import kernel


@kernel
def minus(a, b):
    """a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def dot(a, b):
    """Scalar product, summed from the left."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def scaled(a, s):
    """a times a number."""
    return a[0] * s, a[1] * s, a[2] * s


@kernel
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def vector(array):
    """The first three elements of an array."""
    return array[0], array[1], array[2]


def _place(context, builder, array_type, array, index, width):
    """Pointer to the first of the `width` values of a row of a C-contiguous array."""
    data = context.make_array(array_type)(context, builder, array).data
    return builder.gep(data, [builder.mul(index, ir.Constant(index.type, width))])


def _load_vector(builder, pointer):
    """Load three consecutive values."""
    return [builder.load(builder.gep(pointer, [ir.Constant(ir.IntType(64), j)])) for j in range(3)]


@intrinsic
def item(typing_context, array, i):
    """Row i of an (n, 3) array. Unlike indexing in a function of its own, it takes no reference count."""
    def codegen(context, builder, signature, args):
        pointer = _place(context, builder, signature.args[0], *args, 3)
        return context.make_tuple(builder, signature.return_type, _load_vector(builder, pointer))

    return types.UniTuple(types.float64, 3)(array, types.int64), codegen


@intrinsic
def corner(typing_context, corners, t, i):
    """Corner i of triangle t of an (n, 3, 3) array."""
    def codegen(context, builder, signature, args):
        corners, t, i = args
        pointer = _place(context, builder, signature.args[0], corners, builder.add(builder.mul(t, i.type(3)), i), 3)
        return context.make_tuple(builder, signature.return_type, _load_vector(builder, pointer))

    return types.UniTuple(types.float64, 3)(corners, types.int64, types.int64), codegen


@intrinsic
def store_row(typing_context, array, i, row):
    """Write a tuple to row i of an array, whose rows have as many values; rounded to the array's type."""
    def codegen(context, builder, signature, args):
        array, i, row = args
        pointer = _place(context, builder, signature.args[0], array, i, len(signature.args[2]))
        for j in range(len(signature.args[2])):
            value = context.cast(builder, builder.extract_value(row, j), signature.args[2][j], signature.args[0].dtype)
            builder.store(value, builder.gep(pointer, [ir.Constant(ir.IntType(64), j)]))
        return context.get_dummy_value()

    return types.void(array, types.int64, row), codegen
