"""Images on disk for tests of textures."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray


def write_image(path: Path, pixels: NDArray[np.uint8]) -> Path:
    """Write pixels, uint8 (rows, columns, channels), as they are: colours are not multiplied by opacity."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "uint8")
    spec.attribute("oiio:UnassociatedAlpha", 1)
    output = oiio.ImageOutput.create(str(path))
    assert output.open(str(path), spec) and output.write_image(np.ascontiguousarray(pixels)) and output.close()
    return path


def texels(rows: int, columns: int, seed: int = 0) -> NDArray[np.uint8]:
    """Random RGBA."""
    return np.random.default_rng(seed).integers(0, 256, (rows, columns, 4), dtype=np.uint8)
