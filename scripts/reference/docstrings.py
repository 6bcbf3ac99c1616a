"""Docstrings as Markdown: sections in Google style become lists, examples become code."""

from __future__ import annotations

import inspect
import re

ITEMS = ("Args", "Attributes", "Raises", "Yields")
SECTION = re.compile(r"(Args|Attributes|Returns|Raises|Yields|Examples?|Note|Notes):$")
ITEM = re.compile(r"(\*{0,2}[\w.]+(?:, \*{0,2}[\w.]+)*)(?: \([^)]*\))?: (.*)")


def escaped(text: str) -> str:
    """Text that Markdown shows as it is, but for code between backticks."""
    parts = re.split(r"(`[^`]*`)", text)
    for index in range(0, len(parts), 2):
        parts[index] = re.sub(r"([<*\[\]$])", r"\\\1", parts[index])
    return "".join(parts)


def prose(lines: list[str]) -> list[str]:
    """Paragraphs and lists; lines that would be headings or code are text."""
    found = []
    for line in lines:
        if line.startswith("    ") and not line.lstrip().startswith(("-", "*")):
            found.append("    " + line.strip())
        else:
            found.append(re.sub(r"^#", r"\\#", escaped(line)))
    return found


def items(lines: list[str]) -> list[str]:
    """`name: text`, with indented lines that go on, as a list."""
    found: list[str] = []
    for line in inspect.cleandoc("\n".join(["", *lines])).split("\n"):
        match = ITEM.match(line)
        if match:
            names = ", ".join(f"`{name}`" for name in match[1].split(", "))
            found.append(f"- {names}: {escaped(match[2])}")
        elif found and line.startswith(" "):
            found.append(f"  {escaped(line.strip())}")
        elif line.strip():
            found.append(f"- {escaped(line)}" if not found else f"  {escaped(line.strip())}")
    return found


def example(lines: list[str]) -> list[str]:
    """An interactive session, or a program, as code."""
    text = inspect.cleandoc("\n".join(["", *lines])).strip("\n")
    kind = "pycon" if text.lstrip().startswith(">>>") else "python"
    return [f"```{kind}", *text.split("\n"), "```"]


def markdown(docstring: str | None) -> str:
    """A docstring as Markdown."""
    if not docstring:
        return ""
    blocks: list[tuple[str, list[str]]] = [("", [])]
    for line in inspect.cleandoc(docstring).split("\n"):
        match = SECTION.match(line)
        if match:
            blocks.append((match[1], []))
        elif blocks[-1][0] and line and not line.startswith(" "):
            blocks.append(("", [line]))
        else:
            blocks[-1][1].append(line)
    found: list[str] = []
    for title, lines in blocks:
        body = "\n".join(lines).strip("\n").split("\n")
        if title.startswith("Example"):
            found += ["**Example**", "", *example(body)]
        elif title in ITEMS:
            found += [f"**{title.replace('Args', 'Parameters')}**", "", *items(body)]
        elif title:
            text = inspect.cleandoc("\n".join(["", *body])).split("\n")
            found += [f"**{title}**", "", *prose(text)]
        else:
            found += prose(body)
        found.append("")
    return "\n".join(found).strip("\n")
