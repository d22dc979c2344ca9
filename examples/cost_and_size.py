"""How the work grows with the image: four sizes of one scene, two methods that walk frusta through a tree.

Run it with ``python examples/cost_and_size.py``. Pictures and timings are left out, so it takes seconds once the kernels are
compiled, and prints the same on every machine.
"""

import shadowbench as sb

SIZES = (32, 64, 128, 256)
METHODS = [("ptsv", {"culling_planes": "outline"}), ("cluster", {"culling_planes": "outline"})]


def main() -> None:
    """Print tests per sample for each size."""
    print(f"{'size':>10}{'samples':>10}" + "".join(f"{name:>22}" for name, _ in METHODS))
    for size in SIZES:
        results = sb.run("treads", METHODS, size=(size, size), pictures=False, timings=False)
        cells = [results.cell(label) for label in results.labels]
        n_candidates = cells[0].accuracy.lit_candidates
        tests = [cell.counts["test_and_set"] for cell in cells]
        print(f"{f'{size} x {size}':>10}{n_candidates:>10,}"
              + "".join(f"{f'{count:,} ({count / n_candidates:.1f} each)':>22}" for count in tests))


if __name__ == "__main__":
    main()
