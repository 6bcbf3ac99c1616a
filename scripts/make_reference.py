"""Write the reference of every public name as pages for Sphinx, from stubs and docstrings.

    PYTHONPATH=build/python scripts/make_reference.py FOLDER

A page for each public module; the names of `warp` are on a page for each topic. Settings and
environment variables come from their descriptors.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from reference.headers import page as headers_page
from reference.names import public_modules, public_names
from reference.pages import Stubs, entry, is_number, module_page

ROOT = Path(__file__).resolve().parent.parent
WRITTEN: set[Path] = set()
TOPICS = {
    "arrays": "Arrays",
    "derivatives": "Derivatives",
    "devices": "Devices, streams, graphs, memory",
    "errors": "Errors",
    "geometry": "Geometry",
    "interop": "Exchange with other libraries",
    "kernels": "Kernels, functions, modules, launches",
    "language": "Kernel language: other functions",
    "logger": "Messages",
    "textures": "Textures",
    "types": "Types and constants",
    "other": "Modules and other names",
}


def builtin_groups() -> dict[str, str]:
    """Group of each function of the kernel language, by the headings of docs/builtins.md."""
    found, group = {}, ""
    for line in (ROOT / "docs" / "builtins.md").read_text().splitlines():
        if line.startswith("## "):
            group = line[3:]
        elif match := re.match(r"### (\w+)", line):
            found[match[1]] = f"Kernel language: {group[0].lower()}{group[1:]}"
    return found


def homes() -> dict[str, str]:
    """Topic of each name that `warp/__init__.py` imports: the folder it comes from."""
    text = (ROOT / "python" / "warp" / "__init__.py").read_text()
    pattern = r"from warp\._src\.(\w+)[\w.]* import (?:\(\s*)?\w+ as (\w+)"
    return {match[2]: match[1] for match in re.finditer(pattern, text)}


def write(path: Path, text: str) -> None:
    """Writes a page that has changed; Sphinx reads the others from its cache."""
    WRITTEN.add(path)
    if not path.is_file() or path.read_text() != text:
        path.write_text(text)


def slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def write_warp(folder: Path, stubs: Stubs) -> list[str]:
    """Pages of the names of `warp` by topic; returns their file names."""
    groups, sources, pages = builtin_groups(), homes(), {}
    for name, value in public_names("warp"):
        topic = groups.get(name) or TOPICS.get(sources.get(name, ""))
        topic = TOPICS["types"] if isinstance(value, type) and is_number(value) else topic
        if topic is None:
            home = getattr(value, "__module__", "") or getattr(type(value), "__module__", "")
            part = home.split(".")[2] if home.startswith("warp._src.") else "other"
            topic = TOPICS.get(part, TOPICS["other"])
        pages.setdefault(topic, []).append(entry(name, value, stubs))
    names = []
    for topic, entries in sorted(pages.items()):
        text = [f"# {topic}", "", "```{py:currentmodule} warp", "```", "", "\n\n".join(entries)]
        write(folder / f"warp-{slug(topic)}.md", "\n".join(text) + "\n")
        names.append(f"warp-{slug(topic)}")
    return names


def write_settings(folder: Path) -> None:
    """The settings of `wp.config` with their environment variables."""
    from warp._src.config import SETTINGS

    lines = ["# Settings and environment variables", ""]
    lines += [
        "Assign a setting as `wp.config.<name> = value`, before the work that it affects.",
        "",
    ]
    lines += ["| setting | default | environment variable | meaning |", "| --- | --- | --- | --- |"]
    for one in SETTINGS.values():
        cells = [f"`{one.name}`", f"`{one.default!r}`"]
        cells += [" ".join(f"`{name}`" for name in one.env), one.doc]
        lines.append(
            "| "
            + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells)
            + " |"
        )
    write(folder / "settings.md", "\n".join(lines) + "\n")


def main() -> None:
    import warp

    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    stubs = Stubs(Path(warp.__file__).with_suffix(".pyi"))
    listed = write_warp(folder, stubs)
    modules = [name for name in public_modules() if name != "warp"]
    for module in modules:
        write(folder / f"{module}.md", module_page(module))
    write_settings(folder)
    write(folder / "cpp.md", headers_page(ROOT / "include" / "warp"))
    lines = [
        "# Reference",
        "",
        "```{toctree}",
        ":caption: warp",
        ":maxdepth: 1",
        "",
        *listed,
        "```",
    ]
    lines += ["", "```{toctree}", ":caption: Modules", ":maxdepth: 1", "", *modules, "```"]
    lines += ["", "```{toctree}", ":caption: Settings", ":maxdepth: 1", "", "settings", "```"]
    lines += ["", "```{toctree}", ":caption: C and C++", ":maxdepth: 1", "", "cpp", "```", ""]
    write(folder / "index.md", "\n".join(lines))
    for old in set(folder.glob("*.md")) - WRITTEN:
        old.unlink()


if __name__ == "__main__":
    main()
