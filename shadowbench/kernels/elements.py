"""Access to elements of a record's arrays that costs no reference count.

A kernel that takes an array out of a record (``record.field``) counts a reference, with an atomic instruction, and
another when it is done. That is nothing per frame, but a third of the time of a ray. These intrinsics go straight
to the memory. Indices are not checked, and arrays must be contiguous.
"""

from numba.core import types
from numba.extending import intrinsic


def pointer(context, builder, record, value, field):
    """Data pointer of an array in a record."""
    index = record.fields.index(field)
    return context.make_array(record.types[index])(context, builder, builder.extract_value(value, index)).data


@intrinsic(prefer_literal=True)
def get(typing_context, record, field, index):
    """``record.field.flat[index]``; the field's name is a literal, the index an int64."""
    name = field.literal_value
    array = record.types[record.fields.index(name)]

    def codegen(context, builder, signature, args):
        data = pointer(context, builder, signature.args[0], args[0], name)
        return context.unpack_value(builder, array.dtype, builder.gep(data, [args[2]]))

    return array.dtype(record, field, types.int64), codegen


@intrinsic(prefer_literal=True)
def put(typing_context, record, field, index, value):
    """``record.field.flat[index] = value``."""
    name = field.literal_value
    array = record.types[record.fields.index(name)]

    def codegen(context, builder, signature, args):
        data = pointer(context, builder, signature.args[0], args[0], name)
        context.pack_value(builder, array.dtype, args[3], builder.gep(data, [args[2]]))
        return context.get_dummy_value()

    return types.void(record, field, types.int64, array.dtype), codegen


@intrinsic(prefer_literal=True)
def increment(typing_context, record, field, index):
    """``record.field.flat[index] += 1``, for integers."""
    name = field.literal_value

    def codegen(context, builder, signature, args):
        place = builder.gep(pointer(context, builder, signature.args[0], args[0], name), [args[2]])
        value = builder.load(place)
        builder.store(builder.add(value, value.type(1)), place)
        return context.get_dummy_value()

    return types.void(record, field, types.int64), codegen
