"""Pages of a comparison: one table for a look, one of everything, as Markdown and HTML."""

import json

from warp.compare._programs import PROGRAMS
from warp.compare._run import OWN, PACKAGES
from warp.report._html import make_page

TITLE = "Comparison of packages"
NOTES = """
Times are those of the fastest run of the program, with the result waited for; *gradient* is a run
with its derivative. *First* is the first run, which compiles. *Memory* is the growth of the
process on CPUs, the compiler's included, and of the memory in use on GPUs. *Error* is the norm of
the difference to NumPy in float64, relative; *gradient error* is that of the derivative along a
random direction, against central differences in float64. A dash is a program that a package has no
derivative for, or that was not written for it.
""".strip()


def write_pages(folder, head, records):
    """Write `compare.md`, `compare.html` and `compare.jsonl`.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lines = markdown(head, records)
    (folder / "compare.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "compare.html").write_text(make_page(TITLE, lines), encoding="utf-8")
    with open(folder / "compare.jsonl", "w", encoding="utf-8") as file:
        for record in (head, *records):
            file.write(json.dumps(record) + "\n")


def markdown(head, records):
    """Lines of the page."""
    packages = [name for name in PACKAGES if any(r["package"] == name for r in records)]
    programs = [name for name in PROGRAMS if any(r["program"] == name for r in records)]
    at = {(r["program"], r["package"]): r for r in records}
    found = {r["package"]: r["version"] for r in records if "version" in r}
    versions = [f"{name}: {found.get(name, 'none')}" for name in packages]
    device = head["devices"].get(head["device"], head["device"])
    machine = device if head["device"] != "cpu" else f"{head['processor']}, {head['cores']} cores"
    lines = [f"# {TITLE}", "", f"{head['time'][:10]}, {machine}. {', '.join(versions)}.", "", NOTES]
    if head.get("load", 0.0) > 1.5 * head["cores"]:
        lines += [
            "",
            f"Other processes ran at the same time: {head['load']:.0f} wanted {head['cores']} "
            "cores. Times are longer than on a machine at rest, by different factors.",
        ]
    if head["quick"]:
        lines += ["", "Sizes are those of a quick run, which measures launches more than work."]
    for title, key in (
        ("Run time in ms", "forward_s"),
        ("Run time with gradient in ms", "gradient_s"),
    ):
        rows = [_row(name, packages, at, key) for name in programs]
        rows = [row for row in rows if set(row[1:]) != {"-"}]
        lines += ["", f"## {title}", ""] + _table(["program", *packages], rows)
    lines += ["", "## Everything", ""] + _everything(programs, packages, at)
    lines += _failures(programs, packages, at)
    return [*lines, "", "## Programs", "", *_summaries(programs, at)]


def _table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows]


def _figure(value, scale=1.0):
    if value is None:
        return "-"
    return f"{scale * value:.0f}" if scale * value >= 1000.0 else f"{scale * value:.3g}"


def _ratio(value):
    """Two digits that count, without a power of ten: `0.037x`, `4.5x`, `270x`."""
    return f"{float(f'{value:.1e}'):.10g}x"


def _row(program, packages, at, key):
    """Times, each of another package with its ratio to that of this one."""
    own = at.get((program, OWN), {}).get(key)
    cells = []
    for package in packages:
        time = at.get((program, package), {}).get(key)
        ratio = f" ({_ratio(time / own)})" if time and own and package != OWN else ""
        cells.append(_figure(time, 1e3) + ratio)
    return [program, *cells]


def _everything(programs, packages, at):
    head = ["program", "package", "first ms", "run ms", "first gradient ms", "gradient ms"]
    head += ["memory MiB", "error", "gradient error"]
    rows = []
    for program in programs:
        for package in packages:
            record = at.get((program, package), {})
            if record.get("status") != "ok":
                continue
            times = ("first_s", "forward_s", "gradient_first_s", "gradient_s")
            row = [program, package, *(_figure(record.get(key), 1e3) for key in times)]
            row += [_figure(record.get("memory_mib"))]
            errors = (record.get("error"), record.get("gradient_error"))
            rows.append(row + ["-" if e is None else f"{e:.1e}" for e in errors])
    return _table(head, rows)


def _failures(programs, packages, at):
    rows = []
    for program in programs:
        for package in packages:
            record = at.get((program, package), {})
            reason = record.get("reason") or record.get("gradient_reason")
            if reason:
                what = "gradient" if record["status"] == "ok" else record["status"]
                rows.append([program, package, what, reason.replace("|", "\\|")])
    return (
        ["", "## Without a result", "", *_table(["program", "package", "what", "why"], rows)]
        if rows
        else []
    )


def _summaries(programs, at):
    sizes = {program: record["size"] for (program, _), record in at.items()}
    return _table(
        ["program", "what it does", "size"],
        [[name, PROGRAMS[name].summary, sizes[name]] for name in programs],
    )
