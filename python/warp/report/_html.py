"""Markdown as one HTML page that needs no other file."""

import html
import re

CSS = """
:root{color-scheme:light dark}
body{font:15px/1.5 system-ui,sans-serif;max-width:76rem;margin:2rem auto;padding:0 1rem}
table{border-collapse:collapse;margin:.6rem 0;display:block;overflow-x:auto;\
background:linear-gradient(to right,Canvas 30%,transparent),\
linear-gradient(to left,Canvas 30%,transparent) 100% 0,\
linear-gradient(to right,#8888,transparent),linear-gradient(to left,#8888,transparent) 100% 0;\
background-repeat:no-repeat;background-size:32px 100%,32px 100%,10px 100%,10px 100%;\
background-attachment:local,local,scroll,scroll}
td,th{padding:.15rem .6rem;border-bottom:1px solid #8886;text-align:left}
th{cursor:pointer;white-space:nowrap}
th[aria-sort=ascending]::after{content:" \\2191"}
th[aria-sort=descending]::after{content:" \\2193"}
td{font-variant-numeric:tabular-nums}
tbody tr:hover{background:#8882}
figure{margin:1rem 0;overflow-x:auto}
svg{max-width:100%;min-width:36rem;height:auto;color:inherit!important}
nav{columns:14rem;margin:1rem 0;padding:.6rem 1rem;border:1px solid #8886;border-radius:8px}
nav a{display:block}
a{color:inherit}
h2{scroll-margin-top:1rem}
.green{color:#2a9d6f}.amber{color:#b5830f}.red{color:#d1476b}
"""
SORT = """
for (const head of document.querySelectorAll("th")) head.onclick = () => {
  const body = head.closest("table").tBodies[0], place = head.cellIndex;
  const down = head.getAttribute("aria-sort") === "ascending";
  for (const other of head.parentNode.cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const value = row => row.cells[place].textContent;
  const number = text => text === "never" ? Infinity : parseFloat(text);
  const order = (a, b) => {
    const x = number(value(a)), y = number(value(b));
    if (isNaN(x) || isNaN(y)) return value(a).localeCompare(value(b));
    return x === y ? 0 : x - y;
  };
  const rows = [...body.rows].sort(order);
  body.append(...(down ? rows.reverse() : rows));
};
"""


def make_page(title, lines, figures=None):
    """Lines of Markdown as one page: contents, sorted tables, figures with values.

    Args:
        figures: SVG texts by name and kind; those of a name stand where its comment line is.
    """
    parts, table, contents = [], [], []

    def flush():
        if table:
            parts.append(_html_table(table))
            table.clear()

    for line in lines:
        if line.startswith("|"):
            if not line.startswith("|---"):
                table.append([c.strip() for c in re.split(r"(?<!\\)\|", line)[1:-1]])
            continue
        flush()
        if match := re.fullmatch(r"<!--(.*)-->", line):
            drawn = figures[match[1]].values()
            parts += [f"<figure>{svg}</figure>" for svg in drawn]
        elif match := re.match(r"(#+) (.*)", line):
            level, name = len(match[1]), re.sub(r"\W+", "-", match[2].lower()).strip("-")
            parts.append(f'<h{level} id="{name}">{_inline(match[2])}</h{level}>')
            if level == 2:
                contents.append(f'<a href="#{name}">{_inline(match[2])}</a>')
        elif line.startswith("- "):
            parts.append(f"<li>{_inline(line[2:])}</li>")
        elif line:
            parts.append(f"<p>{_inline(line)}</p>")
    flush()
    if len(contents) > 1:
        parts.insert(1, f"<nav>{''.join(contents)}</nav>")
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{CSS}</style>"
        + "\n".join(parts)
        + f"<script>{SORT}</script></html>"
    )


def _html_table(rows):
    """A table whose first row is its head, if it has words."""
    head = "".join(f'<th scope="col">{_inline(cell)}</th>' for cell in rows[0])
    lines = []
    for row in rows[1:]:
        cells = "".join(f"<td{_tint(cell)}>{_inline(cell)}</td>" for cell in row)
        lines.append(f"<tr>{cells}</tr>")
    head = f"<thead><tr>{head}</tr></thead>" if any(rows[0]) else ""
    return f"<table>{head}<tbody>{''.join(lines)}</tbody></table>"


def _tint(cell):
    return f' class="{cell}"' if cell in ("green", "amber", "red") else ""


def _inline(text):
    text = html.escape(text, quote=False).replace("\\|", "|")
    text = re.sub(r"\*\*(.+?)\*\*", r"<strong>\1</strong>", text)
    text = re.sub(r"(?<![\w*])\*(\w[^*]*)\*(?![\w*])", r"<em>\1</em>", text)
    return re.sub(r"`(.+?)`", r"<code>\1</code>", text)
