"""Command line: `python -m warp.report stability [CASE ...]`."""

import importlib
import sys
from pathlib import Path

import warp as wp
from warp.report._command import SCENES, make_parser
from warp.report._records import RecordFile, provenance
from warp.report._remote import LostWorkError, Remote
from warp.report._run import Progress
from warp.report._worker import load
from warp.report.stability._case import SECTIONS, VERDICTS, expand, registered, run_case
from warp.report.stability._pages import reproducer, write_markdown

MODULES = (
    "dynamics",
    "orbits",
    "materials",
    "elements",
    "geometry",
    "shapes",
    "rotations",
    "matrices",
)
MODULES += ("floats", "sums", "structures", "horizons", "kinetics", "fields", "forms")


def prepare(device):
    """Register all cases and the scenes that they refer to; the function that runs one."""
    wp.config.quiet = True
    for module in MODULES:
        importlib.import_module(f"warp.report.stability.{module}")
    for file in sorted(SCENES.glob("[a-z]*.py")):
        load(str(file))
    return lambda name: run_case(name, device)


def run(names=(), *, device="cpu", limit=60.0, output=None):
    """Records of the cases.

    Args:
        names: such as 'R', 'R1' or 'D1-D9'; all by default.
        limit: seconds a case may take; each runs in a process that may be ended. None runs them
            in this one.
        output: folder of `stability.jsonl` and `stability.md`, if any. A file that cannot be
        written
            there is said and kept in memory.

    Raises:
        ValueError: no case of a name.
    """
    answer = prepare(device)
    chosen = expand(names)
    remote = Remote(prepare, (device,), limit)
    progress, records, head = Progress(len(chosen)), [], provenance((device,))
    file = RecordFile(Path(output) / "stability.jsonl", head) if output else None
    try:
        for name in chosen:
            try:
                found = answer(name) if limit is None else remote.ask(name)
            except LostWorkError as lost:
                found = [_lost(name, device, str(lost))]
            records += found
            for record in found if file else ():
                file.append(record)
            progress.step(name)
    except KeyboardInterrupt:
        print("interrupted: the cases so far follow", file=sys.stderr)
    finally:
        remote.stop()
    if file:
        file.close()
        try:
            write_markdown(Path(output) / "stability.md", head, records)
        except OSError as error:
            text = f"cannot write to '{output}': {error.strerror}"
            print(f"warp.report stability: {text}", file=sys.stderr)
    return records


def _lost(name, device, reason):
    check = {"what": "ended", "verdict": "fail", "text": reason, "operands": {}}
    record = {"case": name, "summary": registered()[name].summary, "device": device}
    return record | {"dtype": "", "verdict": "fail", "checks": [check]}


def main(arguments=None):
    """Run; the exit status is 1 if a case fails, 2 if the command cannot be carried out."""
    parser = make_parser("stability", limit="a case")
    sections = ", ".join(f"{key} {value}" for key, value in SECTIONS.items())
    parser.add_argument("cases", nargs="*", help=f"R, R1 or D1-D9; sections: {sections}")
    parser.add_argument("--list", action="store_true", help="say which cases there are")
    options = parser.parse_args(arguments)
    try:
        wp.get_device(options.device)
        if options.list:
            prepare(options.device)
            for name in expand(options.cases):
                print(f"{name:4} {registered()[name].summary}")
            return 0
        found = run(
            options.cases, device=options.device, limit=options.limit, output=options.output
        )
    except (ValueError, OSError, wp.WarpError) as error:
        print(f"warp.report stability: {error}", file=sys.stderr)
        return 2
    for record in found:
        for line in reproducer(record):
            print(line)
    print(f"pages: {options.output}/stability.md, stability.jsonl")
    counts = {verdict: 0 for verdict in VERDICTS}
    for record in found:
        counts[record["verdict"]] += 1
    print(", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    return 1 if counts["fail"] else 0


if __name__ == "__main__":
    sys.exit(main())
