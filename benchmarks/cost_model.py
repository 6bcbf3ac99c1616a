"""Widths that the cost model of CPU kernels chooses, beside the fastest.

    python benchmarks/cost_model.py [--only csr,loss] [--programs 30 --seed 4000] [--seconds 0.03]
                                    [--rounds 3] [--json FILE] [--minutes 9] [--limit 1.1]

Every case of shapes.py, and programs of random_programs.py, run forward and backward with 1, 4, 8,
16 and 32 lanes, with the width that the model chooses (`model`), and with the one that stays after
the checks on live launches (`live`), which is what users get. Processes alternate; a time is the
thread's own, and a ratio the median of those of the rounds. Where it is beyond `--limit`, as many
rounds again are made before it counts. A choice is wrong where another width takes less than
1 / `--limit` of its time; these are listed, and the status is 1 if one is wrong live.

`--json` keeps what was measured after each case, and a later run with the same file goes on from
there, so a whole run may be made in pieces: `--minutes` ends one.
"""

import argparse
import json
import math
import statistics
import sys
import tempfile
import time
from pathlib import Path

import _random_programs
from shapes import Package, case_names

WIDTHS = (1, 4, 8, 16, 32)
WAYS = ("forward", "adjoint")
CHOICES = ("model", "live")
# Seconds of a launch below which a ratio says nothing.
SHORTEST = 3e-5


class Bench:
    """A process for each width, and one for each way to choose it."""

    def __init__(self, options, folder):
        self.options, self.folder = options, Path(folder)
        python = sys.executable
        self.packages = {
            "live": Package(python, options, f"{folder}/live"),
            "model": Package(python, options, f"{folder}/model", WARP_CHECK_LANES="0"),
        }
        for width in WIDTHS:
            path = f"{folder}/{width}"
            self.packages[str(width)] = Package(python, options, path, BENCH_LANES=str(width))

    def file_of(self, name):
        """The name that a process is asked for: a case, or the file of a random program."""
        if not name.startswith("seed"):
            return name
        path = self.folder / f"{name}.py"
        program = _random_programs.make(int(name[4:]), "cpu")
        path.write_text(program.text(name), encoding="utf-8")
        return str(path)

    def measure(self, name):
        """Times of every process, by way: {way: {kind: [seconds of each turn]}}."""
        file, found = self.file_of(name), {way: {} for way in WAYS}
        for part in range(2):
            for _ in range(self.options.rounds):
                for kind, package in self.packages.items():
                    turn = package.ask(file)
                    for way in WAYS:
                        if way in turn:
                            found[way].setdefault(kind, []).append(turn[way])
            if all(loss(found[way], "live") <= self.options.limit for way in WAYS) or part:
                break
        return found

    def close(self):
        for package in self.packages.values():
            package.close()


def ratios(times, choice):
    """Time of a choice over that of each width."""
    if choice not in times or min(times[choice]) < SHORTEST:
        return {}
    return {
        width: statistics.median(
            a / b for a, b in zip(times[choice], times[str(width)], strict=True)
        )
        for width in WIDTHS
        if len(times.get(str(width), ())) == len(times[choice])
    }


def loss(times, choice):
    """Time of a choice over that of the fastest width, at least 1; 0 for what is too short."""
    found = ratios(times, choice)
    return max(1.0, *found.values()) if len(found) > 1 else 0.0


def line(name, way, times, limit):
    """One row of the table, or None for what is too short."""
    if not loss(times, "live"):
        return None
    found = ratios(times, "live")
    text = " ".join(f"{found.get(width, math.nan):6.2f}" for width in WIDTHS)
    marks = "".join(" *"[loss(times, choice) > limit] for choice in CHOICES)
    micros = statistics.median(times["live"]) * 1e6
    model = loss(times, "model")
    return f"{name:18} {way:8} {micros:10.1f}  {text}  {model:6.2f} {marks}"


def summary(known, limit):
    """Counts and means by choice, and the names of those that are wrong."""
    lines, wrong = [], 0
    for choice in CHOICES:
        losses = [
            (loss(times, choice), name, way)
            for name, found in known.items()
            for way, times in found.items()
            if loss(times, choice)
        ]
        if not losses:
            continue
        mean = math.exp(statistics.fmean(math.log(one) for one, _, _ in losses))
        over = sorted((one for one in losses if one[0] > limit), reverse=True)
        lines.append(
            f"{choice}: {len(losses)} choices, {len(over)} wrong by more than {limit}, "
            f"mean of chosen / fastest {mean:.3f}"
        )
        lines += [f"  {name} {way}: {one:.2f}" for one, name, way in over]
        wrong = len(over)
    return lines, wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="names of cases, separated by commas")
    parser.add_argument("--programs", type=int, default=0, help="random programs beside the cases")
    parser.add_argument("--seed", type=int, default=4000, help="of the first random program")
    parser.add_argument("--seconds", type=float, default=0.03, help="per time and turn")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--limit", type=float, default=1.1)
    parser.add_argument("--minutes", type=float, default=math.inf)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    options.device, options.processor = "cpu", True
    wanted = options.only.split(",") if options.only else case_names()
    wanted += [f"seed{options.seed + k}" for k in range(options.programs)]
    known = {}
    if options.json and options.json.exists():
        known = json.loads(options.json.read_text(encoding="utf-8"))
    end = time.monotonic() + 60 * options.minutes
    left = [name for name in wanted if name not in known]
    print(f"{'case':18} {'way':8} {'live us':>10}  live / width {WIDTHS}  model / fastest")
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(options, folder)
        while left and time.monotonic() < end:
            name = left.pop(0)
            known[name] = bench.measure(name)
            for way, times in known[name].items():
                if text := line(name, way, times, options.limit):
                    print(text, flush=True)
            if options.json:
                options.json.write_text(json.dumps(known, indent=1), encoding="utf-8")
        bench.close()
    lines, wrong = summary({name: known[name] for name in wanted if name in known}, options.limit)
    print("\n".join(lines))
    if left:
        print(f"{len(left)} of {len(wanted)} cases are left")
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
