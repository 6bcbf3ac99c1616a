"""Kernels of the shapes that users write, beside the peer: times and results.

    python benchmarks/shapes.py --peer /path/to/python [--device cpu] [--only csr,loss]
                                [--rounds 2] [--seconds 0.1] [--processor] [--json out.json]

The kernels (_shape_*.py) are not tuned for any compiler: one
per shape of program, forward and, where it has one, adjoint. `--peer` names a Python that has
NVIDIA Warp; it runs the same text. Two processes, one per package, alternate case by case, so
that other work on the machine hits both; a time is that of the fastest batch in all rounds. With
`--processor` times are those of one processor that works for the program alone, whoever else does.
Columns: rate of ours, adjoint over forward, first launch, how many times faster than the peer it
is (forward and adjoint), largest differences of results and gradients relative to the largest
number of an array, and the error of gradients against central differences, ours and the peer's.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
SCRIPT = HERE / "_shape_cases.py"
TIMES = ("first", "forward", "adjoint_first", "adjoint")


def case_names():
    """The registered cases, in order of registration."""
    sys.path.insert(0, str(HERE))
    import _shape_cases

    return list(_shape_cases.CASES)


class Package:
    """A process that runs cases under one Python; a new one follows where it ends."""

    def __init__(self, python, options, folder, **environment):
        self.folder = Path(folder)
        self.folder.mkdir()
        self.command = [python, str(SCRIPT), "--device", options.device]
        self.command += ["--folder", str(self.folder), "--seconds", str(options.seconds)]
        self.environment = os.environ | {"WARP_CACHE_PATH": str(self.folder / "cache")}
        self.environment |= environment
        if options.processor:
            self.command.append("--processor")
            self.environment["WARP_NUM_THREADS"] = "1"
        if python != sys.executable:
            self.environment.pop("PYTHONPATH", None)
        self.process = None
        self.results = {}

    def start(self):
        self.process = subprocess.Popen(
            self.command,
            env=self.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, name):
        """Run a case, and keep the best of its times; what this turn found."""
        if "error" in self.results.get(name, {}):
            return self.results[name]
        if self.process is None:
            self.start()
        self.process.stdin.write(name + "\n")
        self.process.stdin.flush()
        for line in self.process.stdout:
            if line.startswith('{"case"'):
                found = json.loads(line)
                break
        else:
            found = {"error": f"the process ended with status {self.process.wait()}"}
            self.process = None
        known = self.results.setdefault(name, found)
        for key in TIMES:
            if key in known and key in found:
                known[key] = min(known[key], found[key])
        return found

    def arrays(self, name):
        """The result of the case."""
        path = self.folder / f"{name}.npz"
        return dict(np.load(path)) if path.exists() else {}

    def close(self):
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait()


def difference(ours, peer, kind):
    """The largest relative difference of the outputs, or gradients, of both packages."""
    worst = None
    for name in ours.keys() & peer.keys():
        if name.startswith(kind) and len(ours[name]):
            scale = max(np.abs(peer[name]).max(), 1e-30)
            worst = max(worst or 0.0, float(np.abs(ours[name] - peer[name]).max() / scale))
    return worst


def row(name, ours, peer):
    """One line of the table."""
    if "error" in ours:
        return f"{name:18} ours: {ours['error'][:100]}"
    text = f"{name:18} {ours['items'] / ours['forward'] / 1e6:9.1f} M {ours['unit']}/s"
    text = f"{text:42}" + (" " * 7 if "adjoint" not in ours else "")
    if "adjoint" in ours:
        text += f"{ours['adjoint'] / ours['forward']:6.2f} "
    text += f"{1e3 * ours['first']:6.0f} ms"
    if not peer:
        return text
    if "error" in peer:
        return f"{text}  peer: {peer['error'][:60]}"
    columns = [f"{peer['forward'] / ours['forward']:8.2f}x", 9 * " "]
    if "adjoint" in ours and "adjoint" in peer:
        columns[1] = f"{peer['adjoint'] / ours['adjoint']:8.2f}x"
    for key in ("output_difference", "gradient_difference"):
        columns.append(f"{ours[key]:9.1e}" if ours.get(key) is not None else 9 * " ")
    for result in (ours, peer):
        slope = result.get("slope_error")
        columns.append(f"{slope:8.0e}" if slope is not None else 8 * " ")
    return text + " ".join(columns)


HEADER = (
    f"{'case':18} {'rate':>23}  bwd/fwd    first   forward   adjoint   results gradients"
    "    slope  peer's"
)


def measure(options):
    """Run all wanted cases in turn; results per case."""
    wanted = options.only.split(",") if options.only else case_names()
    unknown = [name for name in wanted if name not in case_names()]
    if unknown:
        sys.exit(f"no case named '{unknown[0]}'; there are {', '.join(case_names())}")
    with tempfile.TemporaryDirectory() as folder:
        packages = {"ours": Package(sys.executable, options, f"{folder}/ours")}
        if options.peer:
            packages["peer"] = Package(options.peer, options, f"{folder}/peer")
        print(HEADER, flush=True)
        for name in wanted:
            for _ in range(options.rounds):
                for package in packages.values():
                    package.ask(name)
            ours = packages["ours"].results[name]
            if options.peer:
                arrays = [package.arrays(name) for package in packages.values()]
                ours["output_difference"] = difference(*arrays, "output")
                ours["gradient_difference"] = difference(*arrays, "gradient")
            print(row(name, ours, options.peer and packages["peer"].results[name]), flush=True)
        for package in packages.values():
            package.close()
    return {key: package.results for key, package in packages.items()}


def summary(results):
    """Geometric means of the ratios, and the cases that are slower than the peer's."""
    lines = []
    for key in ("forward", "adjoint"):
        ratios = {
            name: results["peer"][name][key] / one[key]
            for name, one in results["ours"].items()
            if key in one and key in results["peer"][name]
        }
        if not ratios:
            continue
        mean = np.exp(np.mean(np.log(list(ratios.values()))))
        slower = [f"{name} {ratio:.2f}" for name, ratio in ratios.items() if ratio < 1.0]
        lines.append(f"{key}: {mean:.2f}x the peer in the mean of {len(ratios)}")
        if slower:
            lines.append(f"  slower: {', '.join(slower)}")
    return "\n".join(lines)


def main():
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu", help="cpu or cuda:N")
    parser.add_argument("--peer", help="Python interpreter with NVIDIA Warp installed")
    parser.add_argument("--only", default="", help="names of cases, separated by commas")
    parser.add_argument("--rounds", type=int, default=2, help="turns of each package per case")
    parser.add_argument("--seconds", type=float, default=0.1, help="per time and turn")
    parser.add_argument(
        "--processor", action="store_true", help="processor time of one thread, for busy machines"
    )
    parser.add_argument("--json", help="file for all numbers")
    options = parser.parse_args()
    results = measure(options)
    if options.peer:
        print(summary(results))
    if options.json:
        Path(options.json).write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
