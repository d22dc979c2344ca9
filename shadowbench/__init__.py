"""A reference testbed for hard shadows: certified truth, exact operation counts, timings and pictures.

In Python::

    import shadowbench as sb

    results = sb.run("scene.yaml", ["ptsv", "shadow_map[resolution=512]"])
    results.records()            # one dictionary per scene, frame and method
    results.tests("ptsv")        # the heat map as an array

See `shadowbench.api`.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shadowbench.api import Results, load, run

__version__ = "0.1.0"

__all__ = ["Results", "__version__", "load", "run"]


def __getattr__(name: str) -> Any:
    """Import the Python interface when it is first used, so that the command line starts fast.

    By its name: `source_digest` follows import statements, and kernels do not depend on the interface.
    """
    if name in __all__:
        return getattr(import_module("shadowbench.api"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
