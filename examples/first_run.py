"""A first run: measure three methods on a built-in scene, and look at the results as records and arrays.

Run it with ``python examples/first_run.py``. What it prints are counts, so it prints the same on every machine.
"""

import numpy as np

import shadowbench as sb

METHODS = ["ptsv", "cluster", "shadow_map[resolution=128]"]


def main() -> None:
    """Measure, print a table, look at one heat map, write the report."""
    results = sb.run("plane_box", METHODS, size=(160, 120), repeats=1)

    # Records: one dictionary per cell, ready for pandas.DataFrame(results.records())
    print(f"{'method':<26}{'wrong':>8}{'test_and_set':>14}{'all_work':>12}")
    for record in results.records():
        wrong = record["false_shadow"] + record["false_light"]
        print(f"{record['label']:<26}{wrong:>8}{record['test_and_set']:>14,}{record['all_work']:>12,}")

    # Arrays: one value per view sample
    shadow, tests = results.shadow("ptsv"), results.tests("ptsv")
    row, column = np.unravel_index(int(np.argmax(tests)), tests.shape)
    print(f"\n{np.count_nonzero(shadow):,} of {shadow.size:,} samples are in shadow")
    print(f"the most expensive one for ptsv is at x {column}, y {row}: {tests[row, column]} tests")
    print(f"the shadow map is wrong on {np.count_nonzero(results.errors('shadow_map+resolution=128'))} samples or ties")

    assert results.report().name == "report.html"


if __name__ == "__main__":
    main()
