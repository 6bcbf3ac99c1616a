"""Pages of a run: Markdown, HTML with its figures inside, SVG files and CSV."""

import csv
import statistics
import sys

from warp.report._analysis import (
    GOALS,
    compare,
    counts,
    curves_of,
    error_names,
    label_of,
    scene_parameters,
    table_of_times,
)
from warp.report._html import make_page

try:
    from warp.report._figures import all_figures
except ModuleNotFoundError as error:
    # Everything but figures needs NumPy alone.
    if (error.name or "").partition(".")[0] != "matplotlib":
        raise
    all_figures = None


def write_pages(output, head, records, scenes, earlier=None):
    """Write all pages to a folder; a folder that cannot be written leaves them on the terminal."""
    lines = _summary(head, records)
    if earlier:
        lines += _comparison(records, earlier)
    body, figures = list(lines), {}
    for scene in scenes:
        own = [record for record in records if record["scene"] == scene.name]
        if own:
            text, drawn = _section(scene, own)
            lines += text
            body += text + [f"<!--{scene.name}-->"]
            figures[scene.name] = drawn
    markdown = "\n".join(lines) + "\n"
    try:
        output.mkdir(parents=True, exist_ok=True)
        for name, drawn in figures.items():
            for kind, svg in drawn.items():
                (output / f"{name}_{kind}.svg").write_text(svg, encoding="utf-8")
        (output / "report.md").write_text(markdown, encoding="utf-8")
        (output / "report.html").write_text(
            make_page("Error against run time", body, figures), encoding="utf-8"
        )
        write_csv(records, output / "records.csv")
    except OSError as error:
        print(f"warp.report: cannot write to '{output}': {error.strerror}", file=sys.stderr)
        print(markdown)


def _table(head, rows):
    lines = ["", "| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows] + [""]


def _summary(head, records):
    found = counts(records)
    lines = ["# Error against run time", ""]
    lines.append(f"{found['green']} green, {found['amber']} amber, {found['red']} red.")
    if head.get("interrupted"):
        lines.append(f"**Interrupted**: {len(records)} of {head['planned']} points were measured.")
    if head.get("problem"):
        lines.append(f"**Not stored**: {head['problem']}.")
    devices = ", ".join(f"{alias} ({name})" for alias, name in head["devices"].items())
    rows = [
        ("when", head["time"]),
        ("devices", devices or "none"),
        ("processor", f"{head['processor']}, {head['cores']} cores"),
        ("versions", f"warp {head['warp']}, Python {head['python']}, NumPy {head['numpy']}"),
        *([("commit", head["commit"])] if head["commit"] else []),
        ("sizes", "quick" if head.get("quick") else "full"),
    ]
    if all_figures is None:
        rows.append(("figures", "none: they need the package `matplotlib`"))
    return lines + _table(("", ""), rows)


def _figure(value):
    return f"{value:.2e}" if isinstance(value, float) else str(value)


def _comparison(records, earlier):
    head, old = earlier
    rows = compare(records, old)
    lines = ["## Against the run of " + head["time"], ""]
    for judgement in ("worse", "better", "noise"):
        chosen = [row for row in rows if row[4] == judgement]
        lines.append(f"- {len(chosen)} {judgement}")
    worse = [row for row in rows if row[4] == "worse"]
    if worse:
        lines += _table(
            ("scene", "point", "what", "before", "now"),
            [(r["scene"], _point(r), what, _figure(a), _figure(b)) for r, what, a, b, _ in worse],
        )
    return [*lines, ""]


def _point(record):
    words = [f"{k}={_short(v)}" for k, v in record["parameters"].items()]
    return ", ".join([*words, record["dtype"], record["device"]])


def _short(value):
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _milliseconds(seconds):
    return "never" if seconds is None else f"{1e3 * seconds:.3g}"


def _section(scene, records):
    """A scene's text and its figures."""
    found = counts(records)
    lines = [f"## {scene.name}", "", scene.summary, ""]
    lines.append(", ".join(f"{count} {name}" for name, count in found.items()) + ".")
    if len(scene.sweep.values) > 1:
        varying = [
            name
            for name in scene_parameters(records)
            if len({str(record["parameters"].get(name)) for record in records}) == 1
        ]
        for name in error_names(records):
            lines += _times(records, scene.sweep.name, name, varying)
    bars = {name: max(r["bars"].get(name, 0.0) for r in records) for name in error_names(records)}
    bars = {name: bar for name, bar in bars.items() if bar > 0.0}
    if bars:
        text = ", ".join(f"{name} {bar:.1e}" for name, bar in bars.items())
        lines += [
            f"Error bar of the reference: {text}. Errors below ten times that are not judged."
        ]
    hidden = sum(len(record["unjudged"]) for record in records)
    if hidden:
        lines += [f"{hidden} errors were too small for the reference and are left out."]
    lines += _noisy(records) + _peer(records, scene.sweep.name) + _lost(records)
    drawn = all_figures(scene, records) if all_figures else {}
    return [*lines, ""], drawn


def _times(records, axis, name, fixed):
    """Run times until an error is reached; curves that reach none are only counted."""
    found = table_of_times(records, axis, name)
    rows = [
        (label_of(key, fixed), "-" if order is None else f"{order:.2f}")
        + tuple(map(_milliseconds, times))
        for key, order, times in found
        if any(time is not None for time in times)
    ]
    lines = []
    if rows:
        lines += ["", f"Run time in ms until the error of `{name}` is at most"]
        lines += _table(("curve", "order", *(f"{goal:.0e}" for goal in GOALS)), rows)
    if len(rows) < len(found):
        never = len(found) - len(rows)
        lines += [f"{never} of {len(found)} curves never reach an error of `{name}` of 1e-02.", ""]
    return lines


def _noisy(records):
    noisy = [record for record in records if record.get("spread", 0.0) > 0.05]
    if not noisy:
        return []
    return [f"Run times of {len(noisy)} of {len(records)} points spread by more than 5 %."]


def _peer(records, axis):
    """Ratios to the peer by curve, where it was measured; those of errors for the worst error."""
    if not any("peer" in record for record in records):
        return []
    rows, reasons = [], []
    for key, curve in curves_of(records, axis).items():
        both = [r for r in curve if r["status"] == "ok" and r["peer"]["status"] == "ok"]
        reasons += [
            r["peer"]["reason"] for r in curve if r["peer"]["status"] not in ("ok", r["status"])
        ]
        if both:
            times = [(r["seconds"]["median"], r["peer"]["seconds"]["median"]) for r in both]
            own, other = (statistics.geometric_mean([pair[k] for pair in times]) for k in (0, 1))
            errors = [
                (_worst(r["errors"]), _worst(r["peer"]["errors"])) for r in both if r["errors"]
            ]
            row = [label_of(key), f"{len(both)} of {len(curve)}", _milliseconds(own)]
            row += [_milliseconds(other), f"{other / own:.2g}"]
            rows.append(
                row + [_figure(max(e[k] for e in errors)) if errors else "-" for k in (0, 1)]
            )
    lines = ["", "Against the peer: geometric means of run times in ms, largest errors"]
    head = ("curve", "points", "time", "peer", "peer / own", "error", "error of the peer")
    lines += _table(head, rows) if rows else ["", "The peer has no point with a result.", ""]
    if reasons:
        lines += [f"{len(reasons)} points of the peer have no result, such as: {reasons[0]}", ""]
    return lines


def _worst(errors):
    return max(errors.values(), default=0.0)


def _lost(records):
    shown = [r for r in records if r["verdict"] != "green"]
    if not shown:
        return []
    rows = [
        (r["verdict"], _point(r), r["status"], r["expected"], r["reason"].replace("|", "\\|"))
        for r in shown
    ]
    return _table(("", "point", "status", "expected", "why"), rows)


def write_csv(records, path):
    """One line a point, a column a parameter and an error."""
    parameters, names = scene_parameters(records), error_names(records)
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        head = ["scene", "device", "dtype", *parameters, "status", "verdict"]
        times = ["setup", "first", "median", "least", "p95", "read", "gradient"]
        writer.writerow([*head, *(f"{t}_s" for t in times), *(f"error_{n}" for n in names)])
        for record in records:
            row = [record["scene"], record["device"], record["dtype"]]
            row += [record["parameters"].get(name, "") for name in parameters]
            row += [record["status"], record["verdict"]]
            row += [record.get("seconds", {}).get(name, "") for name in times]
            writer.writerow([*row, *(record["errors"].get(name, "") for name in names)])
