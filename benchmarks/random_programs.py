"""Search for slow programs: random kernels beside the plain schedule and the peer.

    python benchmarks/random_programs.py [--count 20] [--seed 0] [--device cpu]
                                         [--peer /path/to/python] [--seconds 0.05] [--json FILE]

Each seed is a program (_random_programs.py): streams, gathers, loops with bounds from data, shared
lists, break, recurrences through arrays, tables, small matrices, structs, branches, atomics, from
one thread to millions. It runs forward and backward in alternating processes: this package,
this package with scalar threads (CPU), and, with `--peer`, NVIDIA Warp. Where this package takes
more than `--plain-limit` times the plain schedule's time, or is less than `--peer-limit` times as
fast as the peer, the program is a loser: parts are taken away as long as it stays one, and what is
left is printed. Ends with status 1 if there were any.
"""

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path

import _random_programs
from shapes import Package, difference

# Seconds of a launch below which a ratio says nothing.
SHORTEST = 3e-5
WAYS = ("forward", "adjoint")


class Bench:
    """The packages, and what they took for programs."""

    def __init__(self, options, folder):
        self.options, self.folder = options, Path(folder)
        self.count = 0
        self.packages = {"ours": Package(sys.executable, options, self.folder / "ours")}
        if options.device == "cpu":
            self.packages["plain"] = Package(
                sys.executable, options, self.folder / "plain", BENCH_LANES="1"
            )
        if options.peer:
            self.packages["peer"] = Package(options.peer, options, self.folder / "peer")

    def measure(self, program):
        """Times of a program by package, by direction."""
        self.count += 1
        name = f"program{self.count}"
        found = {}
        for _ in range(self.options.rounds):
            for kind, package in self.packages.items():
                path = self.folder / kind / f"{name}.py"
                path.write_text(program.text(name), encoding="utf-8")
                package.ask(str(path))
                found[kind] = package.results[str(path)]
        arrays = {kind: package.arrays(name) for kind, package in self.packages.items()}
        for other in ("plain", "peer"):
            if other in arrays:
                found[f"difference_{other}"] = difference(arrays["ours"], arrays[other], "output")
        return found

    def losses(self, found):
        """(direction, other package, ratio) where this package is too slow."""
        ours = found["ours"]
        if "error" in ours:
            return [("error", ours["error"], 0.0)]
        limits = {"plain": 1.0 / self.options.plain_limit, "peer": self.options.peer_limit}
        lost = []
        for other, limit in limits.items():
            for key in WAYS:
                theirs = found.get(other, {}).get(key, 0.0)
                if theirs > SHORTEST and key in ours and theirs / ours[key] < limit:
                    lost.append((key, other, theirs / ours[key]))
        return lost

    def reduced(self, program, lost):
        """The smallest program that still loses in the same way."""
        kinds = {(key, other) for key, other, _ in lost}
        for smaller in program.smaller():
            again = self.losses(self.measure(smaller))
            if kinds & {(key, other) for key, other, _ in again}:
                return self.reduced(smaller, again)
        return program, lost

    def close(self):
        for package in self.packages.values():
            package.close()


def ratio(found, other, key):
    ours, theirs = found["ours"].get(key), found.get(other, {}).get(key)
    return theirs / ours if ours and theirs else None


def shown(value):
    return f"{value:8.2f}" if value is not None else 8 * " "


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of the first program")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--peer", help="Python interpreter with NVIDIA Warp installed")
    parser.add_argument("--seconds", type=float, default=0.05, help="per time and turn")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--plain-limit", type=float, default=1.15)
    parser.add_argument("--peer-limit", type=float, help="default: 2 on a CPU, 1 on a GPU")
    parser.add_argument("--wall", dest="processor", action="store_false", help="wall time")
    parser.add_argument("--no-reduction", action="store_true")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    kind = options.device.partition(":")[0]
    options.processor = options.processor and kind == "cpu"
    options.peer_limit = options.peer_limit or (2.0 if kind == "cpu" else 1.0)
    rows, losers = [], []
    print(f"{'seed':>5} {'ns':>8} {'bwd ns':>8}   plain/ours fwd bwd   peer/ours fwd bwd  program")
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(options, folder)
        for seed in range(options.seed, options.seed + options.count):
            program = _random_programs.make(seed, kind)
            found = bench.measure(program)
            lost = bench.losses(found)
            times = [found["ours"].get(key, 0.0) / program.size * 1e9 for key in WAYS]
            ratios = [ratio(found, other, key) for other in ("plain", "peer") for key in WAYS]
            rows.append({"seed": seed, "program": program.title(), "ratios": ratios, **found})
            print(
                f"{seed:5} {times[0]:8.2f} {times[1]:8.2f} {'  '.join(map(shown, ratios))}  "
                f"{program.title()}{' *' if lost else ''}",
                flush=True,
            )
            if lost:
                if not options.no_reduction and lost[0][0] != "error":
                    program, lost = bench.reduced(program, lost)
                losers.append((seed, program, lost))
        bench.close()
    for name, column in zip(("plain", "plain", "peer", "peer"), range(4), strict=True):
        values = [row["ratios"][column] for row in rows if row["ratios"][column]]
        if values:
            mean = math.exp(sum(map(math.log, values)) / len(values))
            way = ("forward", "backward")[column % 2]
            print(f"{name}/ours {way}: mean {mean:.2f}, lowest {min(values):.2f} of {len(values)}")
    for seed, program, lost in losers:
        print(f"\nseed {seed} loses: {program.title()}")
        for key, other, value in lost:
            print(f"  {key}: {value:.2f} of {other}" if key != "error" else f"  error: {other}")
        print(program.text("loser"))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    sys.exit(1 if losers else 0)


if __name__ == "__main__":
    main()
