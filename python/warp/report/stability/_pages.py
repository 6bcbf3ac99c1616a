"""Text of the stability catalogue's results."""

from warp.report.stability._case import SECTIONS, VERDICTS


def _figures(check):
    if "text" in check:
        return check["text"]
    return f"error {check['error']:.3g}, limit {check['limit']:.3g}"


def reproducer(record):
    """Lines that say what failed in a case, with the operands of the largest error exactly."""
    lines = []
    for check in record["checks"]:
        if check["verdict"] != "fail":
            continue
        where = f"{record['case']} {record['device']} {record['dtype']}".strip()
        lines.append(f"fail: {where}: {check['what']}: {_figures(check)}")
        for name, value in check["operands"].items():
            lines.append(f"    {name} = {value!r}")
        command = f"python -m warp.report stability {record['case']} --device {record['device']}"
        lines.append(f"    {command}")
    return lines


def write_markdown(path, head, records):
    """A table for each section, then each failure with its operands."""
    lines = ["# Numerical stability", ""]
    lines.append(", ".join(f"{key}: {value}" for key, value in head.items() if key != "schema"))
    lines += ["", "| section | " + " | ".join(VERDICTS) + " |", "| --- |" + " ---: |" * 4]
    for key, title in SECTIONS.items():
        own = [record["verdict"] for record in records if record["case"][0] == key]
        if own:
            counts = " | ".join(str(own.count(verdict)) for verdict in VERDICTS)
            lines.append(f"| {key}: {title} | {counts} |")
    lines += ["", "| case | precision | verdict | worst check |", "| --- | --- | --- | --- |"]
    for record in records:
        worst = max(record["checks"], key=_badness)
        text = f"{worst['what']}: {_figures(worst)}".replace("|", "\\|").replace("\n", " ")
        name = f"{record['case']}: {record['summary']}"
        lines.append(f"| {name} | {record['dtype']} | {record['verdict']} | {text} |")
    failures = [line for record in records for line in reproducer(record)]
    if failures:
        lines += ["", "## Worst inputs", "", "```", *failures, "```"]
    path.write_text("\n".join(lines) + "\n")


def _badness(check):
    share = check["error"] / check["limit"] if check.get("limit") else 0.0
    return VERDICTS.index(check["verdict"]), share
