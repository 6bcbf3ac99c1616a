"""Command line: `python -m warp.report [SCENE or FILE.py ...]`, or a tool by its name."""

import importlib
import importlib.util
import sys

import warp as wp
from warp.report._analysis import counts
from warp.report._command import choose, make_parser
from warp.report._records import read_records
from warp.report._run import run
from warp.report._scene import Sweep

#: Packages beside this file that have a command line of their own.
TOOLS = ("lean", "search", "stability")


def _parser():
    parser = make_parser(
        "",
        device="such as cpu,cuda:0",
        limit="a point",
        description="Measure scenes: error against run time, stability, drift, gradients. "
        "'stability' in place of scenes runs the catalogue of extreme cases, "
        "'lean' says what scenes use and carry unused.",
    )
    parser.add_argument("scenes", nargs="*", help="names of scenes, or Python files with some")
    parser.add_argument("--list", action="store_true", help="say which scenes there are")
    parser.add_argument("--dtype", help="such as float32,float64")
    parser.add_argument(
        "--sweep", action="append", default=[], help="name=first:last:count or name=a,b,c"
    )
    parser.add_argument("--quick", action="store_true", help="fewer points, small sizes")
    parser.add_argument("--repeats", type=int, default=10, help="timed runs of a point")
    parser.add_argument("--baseline", help="records.jsonl of an earlier run to compare with")
    parser.add_argument(
        "--against", metavar="PYTHON", help="interpreter with NVIDIA Warp, for columns 'peer'"
    )
    return parser


def main(arguments=None):
    """Run; the exit status is 1 if a point is red, 2 if the command cannot be carried out."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if arguments and arguments[0] in TOOLS:
        tool = importlib.import_module(f"warp.report.{arguments[0]}.__main__")
        return tool.main(arguments[1:])
    options = _parser().parse_args(arguments)
    if not options.list and importlib.util.find_spec("matplotlib") is None:
        print('figures need matplotlib: run `pip install "warp-mlir[report]"`', file=sys.stderr)
        return 2
    wp.config.quiet = True
    try:
        scenes = choose(options.scenes)
        if options.list:
            for scene in scenes:
                print(f"{scene.name:24} {scene.summary}")
            return 0
        if options.baseline:
            read_records(options.baseline)
        records = run(
            scenes,
            devices=tuple(options.device.split(",")),
            dtypes=tuple(options.dtype.split(",")) if options.dtype else None,
            sweeps=tuple(Sweep.parse(text) for text in options.sweep),
            quick=options.quick,
            output=options.output,
            baseline=options.baseline,
            against=options.against,
            repeats=options.repeats,
            budget=0.15 if options.quick else 0.5,
            limit=options.limit,
        )
    except (ValueError, OSError) as error:
        print(f"warp.report: {error}", file=sys.stderr)
        return 2
    found = counts(records)
    for record in records:
        if record["verdict"] == "red":
            point = ", ".join(f"{k}={v}" for k, v in record["parameters"].items())
            where = f"{record['device']} {record['dtype']}"
            print(f"red: {record['scene']} {where} {point}: {record['reason']}")
    print(f"pages: {options.output}/report.html, report.md")
    print(f"{found['green']} green, {found['amber']} amber, {found['red']} red")
    return 1 if found["red"] else 0


if __name__ == "__main__":
    sys.exit(main())
