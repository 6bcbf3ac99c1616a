"""Command line: `python -m warp.compare [PROGRAM ...] [--python PACKAGE=PATH ...]`."""

import argparse
import sys
from pathlib import Path

import warp as wp
from warp.compare._pages import write_pages
from warp.compare._programs import PROGRAMS
from warp.compare._run import OWN, PACKAGES, compare


def _parser():
    parser = argparse.ArgumentParser(
        prog="python -m warp.compare",
        description="Run the same programs by several packages: speed, compile time, memory.",
    )
    parser.add_argument("programs", nargs="*", help="names, all by default")
    parser.add_argument("--list", action="store_true", help="say which programs there are")
    parser.add_argument(
        "--python",
        action="append",
        default=[],
        metavar="PACKAGE=PATH",
        help="interpreter that has a package: "
        + ", ".join(name for name in PACKAGES if name != OWN),
    )
    parser.add_argument("--device", default="cpu", help="cpu or cuda:0")
    parser.add_argument("--quick", action="store_true", help="small sizes")
    parser.add_argument("--repeats", type=int, default=20, help="timed runs of a program at most")
    parser.add_argument("--limit", type=float, default=120.0, help="seconds a process may take")
    parser.add_argument("--output", default="build/compare", help="folder of the pages")
    return parser


def main(arguments=None):
    """Run; the exit status is 1 if a program of this package failed, 2 if nothing can be run."""
    options = _parser().parse_args(arguments)
    wp.config.quiet = True
    if options.list:
        for name, program in PROGRAMS.items():
            print(f"{name:12} {program.summary}")
        return 0
    pairs = [text.partition("=") for text in options.python]
    try:
        for (name, equals, path), text in zip(pairs, options.python):
            if not (name and equals and path):
                raise ValueError(f"--python expects PACKAGE=PATH, but got '{text}'")
        head, records = compare(
            options.programs,
            device=options.device,
            pythons={name: path for name, _, path in pairs},
            quick=options.quick,
            repeats=options.repeats,
            limit=options.limit,
        )
        write_pages(Path(options.output), head, records)
    except (ValueError, OSError) as error:
        print(f"warp.compare: {error}", file=sys.stderr)
        return 2
    lost = [r for r in records if r["package"] == OWN and r["status"] != "ok"]
    for record in lost:
        print(f"{record['program']}: {record['status']}: {record.get('reason', '')}")
    print(f"pages: {options.output}/compare.html, compare.md")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
