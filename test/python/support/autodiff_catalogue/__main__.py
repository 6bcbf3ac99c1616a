"""python -m autodiff_catalogue [--device cpu] [--only T1,T2] [--after T5/float32] [--limit 120]

Prints a line of JSON when a case begins and one when it ends, so that a caller that sees the
process die knows where and goes on after it. A case that takes longer than the limit in seconds
ends the process.
"""

import argparse
import json
import signal
import sys
import time

import warp as wp

from . import CASES, FAILED, runs
from .problem import Problem


def report(**values):
    sys.stdout.write("\n" + json.dumps(values) + "\n")
    sys.stdout.flush()


def main():
    """Run the wanted cases one after the other."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--only", default="")
    parser.add_argument("--after", default="")
    parser.add_argument("--limit", type=int, default=120)
    options = parser.parse_args()
    wp.config.quiet = True
    wp.init()
    wanted = runs()
    if options.only:
        wanted = [run for run in wanted if run[0] in options.only.split(",")]
    names = [f"{number}/{precision}" for number, precision in wanted]
    if options.after:
        skip = names.index(options.after) + 1
        wanted, names = wanted[skip:], names[skip:]
    for (number, precision), name in zip(wanted, names):
        report(begin=name)
        signal.alarm(options.limit)
        begin = time.perf_counter()
        try:
            CASES[number].function(Problem(precision, options.device))
            verdict, text = CASES[number].verdict, ""
        except Exception as problem:
            verdict, text = FAILED, f"{type(problem).__name__}: {problem}"
        report(end=name, verdict=verdict, text=text[:1500], seconds=time.perf_counter() - begin)


if __name__ == "__main__":
    main()
