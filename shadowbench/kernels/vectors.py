"""Three-dimensional vectors as tuples of float64: plain + and * in source order, and no memory."""

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


@kernel
def item(array, i):
    """Row i of an (n, 3) array."""
    return array[i, 0], array[i, 1], array[i, 2]


@kernel
def corner(corners, t, i):
    """Corner i of triangle t of an (n, 3, 3) array."""
    return corners[t, i, 0], corners[t, i, 1], corners[t, i, 2]
