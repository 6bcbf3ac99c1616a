"""Write the tutorials of docs/tutorials as Jupyter notebooks.

    scripts/make_notebooks.py FOLDER

Python blocks become cells of code, everything else cells of text.
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TUTORIALS = ROOT / "docs" / "tutorials"
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def cells(text: str):
    """Cells of a page: (kind, text) in order."""
    for index, part in enumerate(re.split(r"```python\n(.*?)```\n?", text, flags=re.DOTALL)):
        if part.strip():
            yield ("code" if index % 2 else "markdown"), part.strip("\n")


def notebook(text: str) -> dict:
    """A page as a notebook of format 4.5."""
    made = []
    for number, (kind, source) in enumerate(cells(text)):
        cell = {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": source}
        if kind == "code":
            cell |= {"execution_count": None, "outputs": []}
        made.append(cell)
    return {"cells": made, "metadata": METADATA, "nbformat": 4, "nbformat_minor": 5}


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for page in sorted(TUTORIALS.glob("*.md")):
        if page.stem != "index":
            text = json.dumps(notebook(page.read_text()), indent=1)
            (folder / f"{page.stem}.ipynb").write_text(text + "\n")


if __name__ == "__main__":
    main()
