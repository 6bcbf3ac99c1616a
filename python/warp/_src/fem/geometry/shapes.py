"""Reference cells - names, entities and small functions that geometries need of them."""

from __future__ import annotations

SIDES = {"line": "point", "triangle": "line", "square": "line", "tet": "triangle", "cube": "square"}
DIMENSIONS = {"point": 0, "line": 1, "triangle": 2, "square": 2, "tet": 3, "cube": 3}
VERTICES = {"point": 1, "line": 2, "triangle": 3, "square": 4, "tet": 4, "cube": 8}


def cell_of(name: str):
    """The record of a reference cell."""
    from warp._src.fem.cells import cell as cells
    from warp._src.fem.cells import rules  # noqa: F401 - cells have rules as `prototype`

    return getattr(cells, name.upper())
