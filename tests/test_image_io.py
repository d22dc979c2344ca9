import numpy as np
import pytest

from shadowbench import image_io


def test_exr_keeps_floats_and_integers_bit_for_bit(tmp_path):
    rng = np.random.default_rng(1)
    floats = rng.normal(size=(7, 11)).astype(np.float32)
    floats[0, 0] = np.inf
    integers = rng.integers(0, image_io.LARGEST_EXACT_INTEGER + 1, (7, 11)).astype(np.int32)
    integers[0, :2] = 0, image_io.LARGEST_EXACT_INTEGER
    flags = rng.random((7, 11)) < 0.5
    none = np.full((7, 11), image_io.NO_TRIANGLE, np.int64)
    image_io.write_exr(tmp_path / "a.exr", {"P.X": floats, "triangle": integers, "candidate": flags, "none": none})
    back = image_io.read_exr(tmp_path / "a.exr")
    assert set(back) == {"P.X", "triangle", "candidate", "none"}
    assert back["P.X"].dtype == np.float32 and np.array_equal(back["P.X"], floats)
    assert all(back[name].dtype == np.uint32 for name in ("triangle", "candidate", "none"))
    assert np.array_equal(back["triangle"], integers)
    assert np.array_equal(back["candidate"], flags)
    assert np.array_equal(back["none"], none)


def test_every_integer_up_to_the_limit_survives(tmp_path):
    values = np.concatenate([np.arange(2**16), image_io.LARGEST_EXACT_INTEGER - np.arange(2**16)]).reshape(512, 256)
    image_io.write_exr(tmp_path / "a.exr", {"tests": values})
    assert np.array_equal(image_io.read_exr(tmp_path / "a.exr")["tests"], values)


def test_identical_images_make_identical_files(tmp_path):
    channels = {"shadow": np.linspace(0, 1, 64, dtype=np.float32).reshape(8, 8)}
    image_io.write_exr(tmp_path / "a.exr", channels)
    image_io.write_exr(tmp_path / "b.exr", channels)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.parametrize("value", [-1, image_io.LARGEST_EXACT_INTEGER + 1])
def test_integers_that_would_be_damaged_are_refused(tmp_path, value):
    with pytest.raises(ValueError, match="tests"):
        image_io.write_exr(tmp_path / "a.exr", {"tests": np.array([[value]])})


def test_png_round_trip(tmp_path):
    pixels = np.random.default_rng(2).integers(0, 256, (9, 5, 3)).astype(np.uint8)
    image_io.write_png(tmp_path / "a.png", pixels)
    assert np.array_equal(image_io.read_png(tmp_path / "a.png"), pixels)


def test_failures_raise_with_the_path(tmp_path):
    missing = tmp_path / "none" / "a.png"
    with pytest.raises(OSError, match=r"a\.png"):
        image_io.write_png(missing, np.zeros((2, 2, 3), np.uint8))
    with pytest.raises(OSError, match=r"a\.png"):
        image_io.read_png(missing)
    with pytest.raises(OSError, match=r"a\.png"):
        image_io.read_exr(missing)


def test_color_ramp_runs_from_dark_to_light():
    ramp = image_io.color_ramp("inferno", 16)
    assert ramp.shape == (16, 3) and np.all(np.diff(ramp.sum(axis=1)) > 0)


def test_text_is_drawn():
    drawn = image_io.draw_text(np.zeros((30, 120, 3), np.uint8), 5, 22, "1024", 18)
    assert drawn.shape == (30, 120, 3) and np.count_nonzero(drawn) > 50
