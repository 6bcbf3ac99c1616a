"""Command line: `python -m warp.report search [BUILTIN ...]`."""

import dataclasses
import sys
from pathlib import Path

import warp as wp
from warp.report._command import make_parser
from warp.report._records import RecordFile, provenance


def main(arguments=None):
    """Run; the exit status is 1 if there is a defect, 2 for a wrong command."""
    parser = make_parser("search", output="search.jsonl")
    parser.add_argument("builtins", nargs="*", help="names; all without any")
    parser.add_argument("--rows", type=int, default=32, help="operands of each kind of extreme")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers")
    parser.add_argument("--dtype", default="float32,float64", help="precisions")
    parser.add_argument("--processes", type=int, default=1, help="how many search at once")
    parser.add_argument("--all", action="store_true", help="print what is good, too")
    options = parser.parse_args(arguments)
    wp.config.quiet = True
    try:
        from warp.report.search import search, without_reference
    except ModuleNotFoundError as error:
        print(f"warp.report search: needs the package '{error.name}'", file=sys.stderr)
        return 2
    dtypes = tuple(options.dtype.split(","))
    counts = dict.fromkeys(("good", "condition", "known", "defect"), 0)
    try:
        wp.get_device(options.device)
        file = RecordFile(Path(options.output) / "search.jsonl", provenance([options.device]))
        for found in search(
            options.builtins,
            dtypes=dtypes,
            rows=options.rows,
            seed=options.seed,
            device=options.device,
            processes=options.processes,
        ):
            counts[found.verdict] += 1
            file.append(dataclasses.asdict(found))
            if options.all or found.verdict != "good":
                print(found, flush=True)
        file.close()
    except KeyboardInterrupt:
        print("interrupted: what was found so far is kept", file=sys.stderr)
    except (ValueError, wp.WarpError) as error:
        print(f"warp.report search: {error}", file=sys.stderr)
        return 2
    if not options.builtins:
        print("without a reference:", ", ".join(without_reference()))
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    return 1 if counts["defect"] else 0


if __name__ == "__main__":
    sys.exit(main())
