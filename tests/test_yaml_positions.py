import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from shadowbench.yaml_positions import Mark, parse_text, parse_value, path_text


def lines(text: str) -> list[str]:
    document = parse_text(text, "f")
    return [document.line(problem) for problem in document.problems]


def test_yaml_1_2_scalars():
    text = "a: 1e-4\nb: no\nc: 014\nd: 2001-01-01\ne: ~\nf: '5'\ng: true\nh: 0x10\n'i': [1, 2.5]\n"
    value = parse_text(text, "f").value
    assert value == {"a": 1e-4, "b": "no", "c": 14, "d": "2001-01-01", "e": None, "f": "5", "g": True, "h": 16,
                     "i": [1, 2.5]}
    assert type(value["a"]) is float and type(value["g"]) is bool


def test_every_key_and_value_has_its_place():
    document = parse_text("a: 1\nb:\n  - x\n  - {c: 3, d: [4]}\n", "f")
    assert document.values == {
        (): Mark(1, 1), ("a",): Mark(1, 4), ("b",): Mark(3, 3), ("b", 0): Mark(3, 5), ("b", 1): Mark(4, 5),
        ("b", 1, "c"): Mark(4, 9), ("b", 1, "d"): Mark(4, 15), ("b", 1, "d", 0): Mark(4, 16)}
    assert document.keys == {("a",): Mark(1, 1), ("b",): Mark(2, 1), ("b", 1, "c"): Mark(4, 6),
                             ("b", 1, "d"): Mark(4, 12)}


def test_an_alias_stands_where_its_anchor_is():
    document = parse_text("a: &x {k: 1}\nb: *x\n", "f")
    assert document.value == {"a": {"k": 1}, "b": {"k": 1}} and not document.problems
    assert document.values["b", "k"] == Mark(1, 11)
    assert document.value["a"] is not document.value["b"]       # an override of one must not change the other


@pytest.mark.parametrize(("text", "expected"), [
    ("a: 1\na: 2\n", ["f:2:1 a duplicate key: first given in line 1"]),
    ("b: {c: 1, c: 2, c: 3}", ["f:1:11 b.c duplicate key: first given in line 1",
                               "f:1:17 b.c duplicate key: first given in line 1"]),
    ("a: .inf\nb: .nan\nc: 1e999", ["f:1:4 a must be a finite number, not .inf",
                                    "f:2:4 b must be a finite number, not .nan",
                                    "f:3:4 c must be a finite number, not 1e999"]),
    ("1: 2", ["f:1:1 a key must be text"]),
    ("? [a]\n: 2", ["f:1:3 a key must be text"]),
    ("a: !foo 3", ["f:1:4 a the tag !foo is not supported: remove it"]),
    ("a: !!set {x}", ["f:1:4 a the tag !!set is not supported: remove it"]),
    ("a: !!int x", ["f:1:4 a 'x' can't be read as int"]),
    ("a: " + "9" * 30, ["f:1:4 a 999999999999999999999999999999 is too large a number"]),
    ("a: " + "9" * 5000, ["f:1:4 a '" + "9" * 39 + "…' can't be read as int"]),
    ('a: "\\ud800"', ["f:1:4 a half of a surrogate pair is no character"]),
    ("<<: {a: 1}", ["f:1:1 << merge keys are not part of YAML 1.2: write the keys out, or use an alias for a whole "
                    "value"]),
    ("a: [1,\n 2", ["f:2:3 YAML: expected ',' or ']', but got '<stream end>'"]),
    ("a: b: c", ["f:1:5 YAML: mapping values are not allowed here"]),
    ("a: *x", ["f:1:4 YAML: found undefined alias 'x'"]),
    ("a: 1\n---\nb: 2", ["f:2:1 YAML: a second document starts here: a scene file holds one"]),
    ("a: 1\nb: \x07", ["f:2:4 YAML: the character U+0007 is not allowed"]),
    ("", ["f:1:1 the file is empty: it needs at least 'geometry'"]),
    ("# only a comment\n", ["f:1:1 the file is empty: it needs at least 'geometry'"]),
    ("a: " + "[" * 5000, ["f:1:35 nested more than 32 levels deep"]),
    ("a: &x [*x]", ["f:1:1 holds more than 50,000 values once aliases are written out"]),
])
def test_problems_name_their_place(text, expected):
    assert lines(text) == expected


def test_a_billion_laughs_end_quickly():
    text = "a0: &a0 [lol]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 12))
    start = time.perf_counter()
    assert lines(text) == ["f:1:1 holds more than 50,000 values once aliases are written out"]
    assert time.perf_counter() - start < 2.0


def test_a_key_that_is_not_printable_stays_on_one_line():
    assert path_text(("a", 0, "b\nc", "d")) == "a[0].'b\\nc'.d"


@pytest.mark.parametrize(("text", "value"), [("16", 16), ("back_faces", "back_faces"), ("[1, 2]", [1, 2]),
                                             ("1e-3", 1e-3), ("{a: 1}", {"a": 1})])
def test_single_values(text, value):
    assert parse_value(text) == value


@pytest.mark.parametrize("text", ["", "  ", "[1", ".nan", "!x 1", "a: b: c"])
def test_bad_single_values(text):
    with pytest.raises(ValueError, match=r"\w"):
        parse_value(text)


plain = st.recursive(
    st.none() | st.booleans() | st.integers(-10**6, 10**6) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text("abcxyz :#-'\"é\n", max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc d", max_size=4), inner, max_size=3),
    max_leaves=12)


@given(plain)
@settings(deadline=None, max_examples=150)
def test_values_agree_with_ruamels_own_loader(value):
    import io

    stream = io.StringIO()
    writer = YAML(typ="safe", pure=True)
    writer.default_flow_style = False       # ruamel writes some texts wrongly in flow style
    writer.dump({"top": value}, stream)
    expected = YAML(typ="safe", pure=True).load(stream.getvalue())
    document = parse_text(stream.getvalue(), "f")
    assert document.value == expected and not document.problems


@given(st.text(max_size=60) | st.text("a:-[]{}&*!|>'\"%@#?, \n\t\\xuU01", max_size=40))
@settings(deadline=None, max_examples=300)
def test_any_text_gives_a_value_or_a_problem(text):
    document = parse_text(text, "f")
    assert document.problems or document.value is not None or text.strip()
    for problem in document.problems:
        assert "\n" not in document.line(problem)
        assert 1 <= problem.mark.line <= text.count("\n") + text.count("\x85") + text.count("\u2028") \
            + text.count("\u2029") + text.count("\r") + 2
