"""The float64 filters against rational arithmetic: what they decide is never wrong, and they decide most."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shadowbench.reference.exact import exact_facing, exact_flags, to_integers
from shadowbench.reference.predicates import ALL_FLAGS, classify, compare, triangle_facing
from tests import brute_force

MODERATE = st.floats(-1e3, 1e3, allow_subnormal=True)
ANY_FINITE = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=True)
LIMITS = {"deadline": None, "max_examples": 150}


def flag_bits(flags):
    return sum(int(flag) << k for k, flag in enumerate(flags))


def vectors(elements, n):
    return st.lists(elements, min_size=n, max_size=n).map(lambda values: np.array(values, np.float64))


def nearly_degenerate(seed):
    """A triangle, light and sample where the sample is some roundings away from an edge plane or the
    triangle."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(1, 3, 3)) * 10.0 ** rng.integers(-6, 6)
    if seed % 5 == 0:
        corners[0, 2] = corners[0, 0] + rng.random() * (corners[0, 1] - corners[0, 0])
    light = np.append(rng.normal(size=3) * 10.0 ** rng.integers(-6, 9), float(seed % 2))
    edge = rng.integers(3)
    u, v = corners[0, edge], corners[0, (edge + 1) % 3]
    on_edge = u + rng.random() * (v - u)
    away = on_edge - light[:3] if light[3] else -light[:3]
    p = on_edge + away * rng.choice([0.0, 1e-9, 0.5, 3.0])
    for _ in range(rng.integers(0, 4)):
        k = rng.integers(3)
        p[k] = np.nextafter(p[k], rng.choice([-np.inf, np.inf]))
    return corners, light, p[None]


def check_classify(corners, light, positions, tie, bias):
    """Compare one pair; return the number of flags that float64 decides."""
    biases = np.array([0.0, bias, 2 * bias])
    facing = int(exact_facing(corners, light)[0])
    filtered = triangle_facing(corners, 0, light)
    assert filtered in (2, facing)
    if facing == 0:
        return 5
    certain, undecided = classify(corners, 0, facing, light, positions, 0, tie, biases)
    truth = flag_bits(brute_force.pair_flags(corners[0], light, positions[0], bias, tie, 0.0))
    assert certain & undecided == 0
    assert truth & ~undecided == certain
    settled = exact_flags(corners, np.array([facing], np.int8), light, positions, np.array([tie]), biases)
    assert settled[0] == truth
    return 5 - undecided.bit_count()


@pytest.mark.parametrize("block", range(4))
def test_nearly_degenerate_input_is_never_decided_wrongly(block):
    decided = 0
    for seed in range(100 * block, 100 * block + 100):
        corners, light, positions = nearly_degenerate(seed)
        tie, bias = [0.0, 1e-12, 1e-3][seed % 3], [0.0, 1e-9][seed % 2]
        decided += check_classify(corners, light, positions, tie, bias)
    # The cases hug the planes on purpose; most remain within reach of float64 all the same.
    assert 100 < decided < 500


@given(vectors(MODERATE, 9), vectors(MODERATE, 3), vectors(MODERATE, 3), st.booleans(), st.floats(0, 1),
       st.floats(0, 1))
@settings(**LIMITS)
def test_moderate_input_is_never_decided_wrongly(corners, light, p, is_point, tie, bias):
    check_classify(corners.reshape(1, 3, 3), np.append(light, float(is_point)), p[None], tie, bias)


@given(vectors(ANY_FINITE, 9), vectors(ANY_FINITE, 3), vectors(ANY_FINITE, 3), st.booleans())
@settings(deadline=None, max_examples=50)
def test_input_of_any_magnitude_is_never_decided_wrongly(corners, light, p, is_point):
    check_classify(corners.reshape(1, 3, 3), np.append(light, float(is_point)), p[None], 0.0, 0.0)


def test_random_input_is_nearly_always_decided():
    rng = np.random.default_rng(5)
    decided = [check_classify(rng.normal(size=(1, 3, 3)), np.append(rng.normal(size=3), 1.0),
                              rng.normal(size=(1, 3)), 1e-3, 1e-3) for _ in range(200)]
    assert sum(decided) == 5 * len(decided)


def test_a_bound_that_is_no_number_decides_nothing():
    assert compare(1.0, np.nan) == compare(np.nan, 1.0) == compare(-np.inf, np.inf) == 1
    assert compare(1.0, 0.5) == 2
    assert compare(-1.0, 0.5) == 0


@given(vectors(ANY_FINITE, 6))
@settings(**LIMITS)
def test_integers_keep_the_ratios(values):
    first, second = to_integers(values[:2], values[2:])
    integers = [*first, *second]
    pivot = max(range(6), key=lambda k: abs(values[k]))
    for value, integer in zip(values, integers, strict=True):
        assert integer * brute_force.Fraction(values[pivot]) == brute_force.Fraction(value) * integers[pivot]


def test_edge_on_triangles_need_no_exact_arithmetic_where_zeros_are_exact():
    wall = np.array([[[0.1, 0.0, 0.3], [0.1, 2.7, 0.3], [0.9, 0.0, 0.7]]])
    assert triangle_facing(wall, 0, np.array([0.0, 1.0, 0.0, 0.0])) == 0
    assert exact_facing(wall, np.array([0.0, 1.0, 0.0, 0.0]))[0] == 0


def test_flags_of_a_plain_case():
    corners = np.array([[[-1.0, 1.0, -1.0], [1.0, 1.0, -1.0], [0.0, 1.0, 1.0]]])
    light = np.array([0.0, 2.0, 0.0, 1.0])
    assert check_classify(corners, light, np.zeros((1, 3)), 1e-3, 1e-3) == 5
    facing = triangle_facing(corners, 0, light)
    biases = np.array([0.0, 1e-3, 2e-3])
    assert classify(corners, 0, facing, light, np.zeros((1, 3)), 0, 1e-3, biases) == (ALL_FLAGS, 0)
