"""A process of its own that prints digests of what methods answer: run by `shadowbench verify`, which compares them.

Usage: ``python -m shadowbench.conformance.fingerprint JSON``, where JSON holds "methods", a list of [name, parameters],
and "plugins", a list of files. It prints a JSON list: a digest each, or null for a method that raised.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from shadowbench import plugins
from shadowbench.algorithm_specs import validate_params
from shadowbench.algorithms import ALGORITHMS
from shadowbench.conformance.suite import THREADED, Cases, fingerprint


def fingerprints(methods: list[tuple[str, dict[str, Any]]]) -> list[str | None]:
    """Digest of each method; None for one that raised."""
    cases = Cases(list(THREADED))
    digests: list[str | None] = []
    for name, params in methods:
        try:
            digests.append(fingerprint(ALGORITHMS[name].load()(validate_params(name, params)), cases))
        except Exception:                       # told with its case by the process that asks
            digests.append(None)
    return digests


if __name__ == "__main__":
    request = json.loads(sys.argv[1])
    plugins.find_installed()
    plugins.load_files(Path(file) for file in request["plugins"])
    print(json.dumps(fingerprints([(name, params) for name, params in request["methods"]])))
