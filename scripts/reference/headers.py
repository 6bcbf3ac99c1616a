"""Reference of C and C++: headers that programs include, with their introductions.

Declarations are printed as the headers have them, comments among them, since these are the
documentation. Sphinx takes the text from the header itself, from its include guard on.
"""

from __future__ import annotations

import re
from pathlib import Path

# Headers for programs, in the order of a first one; others serve the runtime and bindings.
CPP = (
    "SavedModule",
    "Array",
    "Kernel",
    "Device",
    "Memory",
    "SavedGraph",
    "Graph",
    "Error",
    "Version",
)
CPP += ("Mesh", "Bvh", "HashGrid", "Volume", "VoxelGrids", "Sequences", "SparseProduct")
HEADERS = ("warp", *CPP)


def introduction(text: str) -> tuple[str, list[str]]:
    """The title of a header, and the paragraphs of its first comment."""
    end = text.index("#ifndef")
    lines = [re.sub(r"^(//|/\*| \*)/? ?", "", line) for line in text[:end].splitlines()]
    title = re.search(r"\.h - (.*?) -*\*-", lines[0])[1]
    body = [line for line in lines[1:] if "===" not in line and "Apache License" not in line]
    return title, "\n".join(body).strip().split("\n\n")


def paragraph(text: str) -> str:
    """A paragraph as Markdown: indented lines are code."""
    if not text.startswith("  "):
        return text
    code = "\n".join(line[2:] for line in text.splitlines())
    return f"```cpp\n{code}\n```"


def section(folder: Path, name: str) -> str:
    """The section of a header."""
    path = folder / f"{name}.h"
    text = path.read_text()
    title, paragraphs = introduction(text)
    guard = re.search(r"#ifndef (\w+)", text)[1]
    lines = [f"## `warp/{name}.h`: {title[0].lower() + title[1:]}", ""]
    for one in filter(None, paragraphs):
        lines += [paragraph(one), ""]
    lines += [f"```{{literalinclude}} ../../include/warp/{name}.h"]
    lines += [
        ":language: cpp",
        f':start-after: "#define {guard}"',
        f":end-before: '#endif // {guard}'",
    ]
    if f"#endif // {guard}" not in text:
        lines.pop()
    return "\n".join([*lines, "```"])


def page(folder: Path) -> str:
    """The page of all headers."""
    head = """# C and C++

`warp.h` is for C and other languages, the others are for C++ programs that launch what Python
saved ([tutorial](../tutorials/cpp.md)). `find_package(warp)` or `wp.get_include()` finds them.
Functions throw `warp::Error`. Headers of `include/warp` that are not here serve the bindings and
may change.
"""
    return "\n\n".join([head.strip(), *(section(folder, name) for name in HEADERS)]) + "\n"
