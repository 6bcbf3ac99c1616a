"""Widths that the cost model of CPU kernels chooses, beside the fastest.

    python benchmarks/cost_model.py [--only csr,loss] [--seconds 0.05] [--rounds 2] [--json FILE]

Every case of shapes.py runs with the width that the model chooses and with 1, 4, 8, 16 and 32
lanes, forward and backward, by the processor time of one thread. A choice is wrong where another
width takes less than 1 / 1.1 of its time; these are listed, and the command ends with status 1.
"""

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path

from shapes import Package, case_names

WIDTHS = (1, 4, 8, 16, 32)
WAYS = ("forward", "adjoint")
# Seconds of a launch below which a ratio says nothing.
SHORTEST = 3e-5


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="names of cases, separated by commas")
    parser.add_argument("--seconds", type=float, default=0.05, help="per time and turn")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--limit", type=float, default=1.1)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    options.device, options.processor = "cpu", True
    wanted = options.only.split(",") if options.only else case_names()
    losses, wrong = [], []
    with tempfile.TemporaryDirectory() as folder:
        packages = {0: Package(sys.executable, options, f"{folder}/chosen")}
        for width in WIDTHS:
            path = f"{folder}/{width}"
            packages[width] = Package(sys.executable, options, path, BENCH_LANES=str(width))
        print(f"{'case':18} {'way':8} {'chosen us':>10}  chosen / width {WIDTHS}")
        for name in wanted:
            for _ in range(options.rounds):
                for package in packages.values():
                    package.ask(name)
            for way in WAYS:
                times = {w: package.results[name].get(way) for w, package in packages.items()}
                if not times[0] or times[0] < SHORTEST:
                    continue
                ratios = [times[0] / times[w] if times[w] else float("nan") for w in WIDTHS]
                loss = max(max(one for one in ratios if not math.isnan(one)), 1.0)
                losses.append(loss)
                if loss > options.limit:
                    wrong.append((loss, name, way))
                text = " ".join(f"{one:6.2f}" for one in ratios)
                mark = " *" if loss > options.limit else ""
                print(f"{name:18} {way:8} {times[0] * 1e6:10.1f}  {text}{mark}", flush=True)
        results = {str(width): package.results for width, package in packages.items()}
        for package in packages.values():
            package.close()
    if losses:
        mean = math.exp(sum(map(math.log, losses)) / len(losses))
        print(f"{len(losses)} choices, {len(wrong)} wrong, mean of chosen / fastest {mean:.3f}")
    for loss, name, way in sorted(wrong, reverse=True):
        print(f"  {name} {way}: {loss:.2f}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1), encoding="utf-8")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
