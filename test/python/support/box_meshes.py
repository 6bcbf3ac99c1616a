"""Meshes of a box for tests, with shuffled vertices and orders, as NumPy arrays."""

import itertools

import numpy as np

_TRIANGLES = [(0, 1, 3), (0, 3, 2)]
_TETS = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
_AROUND = {2: (0, 1, 3, 2), 3: (0, 1, 3, 2, 4, 5, 7, 6)}
# Orders of vertices that are rotations of the cell.
_ROTATIONS = {
    "triangle": [(0, 1, 2), (1, 2, 0), (2, 0, 1)],
    "square": [(0, 1, 2, 3), (1, 2, 3, 0), (2, 3, 0, 1), (3, 0, 1, 2)],
    "tet": [(0, 1, 2, 3), (1, 2, 0, 3), (0, 2, 3, 1), (3, 1, 0, 2)],
    "cube": [(0, 1, 2, 3, 4, 5, 6, 7), (1, 2, 3, 0, 5, 6, 7, 4), (0, 4, 5, 1, 3, 7, 6, 2)],
}


def box_mesh(cell, n, distortion=0.0, seed=0, shuffle=True):
    """Cells (c, k) and positions (v, d) of a unit box with n cells per axis.

    Interior and boundary vertices move by up to `distortion` cells.
    """
    rng = np.random.default_rng(seed)
    d = 2 if cell in ("triangle", "square") else 3
    strides = (n + 1) ** np.arange(d)
    corners = np.array(list(itertools.product((0, 1), repeat=d)))[:, ::-1] @ strides
    bases = np.array(list(itertools.product(range(n), repeat=d))) @ strides
    parts = {"triangle": _TRIANGLES, "tet": _TETS}.get(cell, [_AROUND[d]])
    cells = np.concatenate([bases[:, None] + corners[list(part)] for part in parts])
    grid = np.stack(np.unravel_index(np.arange((n + 1) ** d), (n + 1,) * d), 1)[:, ::-1] / n
    positions = grid + (rng.random(grid.shape) - 0.5) * distortion / n
    if shuffle:
        order = rng.permutation(len(positions))
        places = np.empty_like(order)
        places[order] = np.arange(len(order))
        positions, cells = positions[order], places[cells]
        cells = cells[rng.permutation(len(cells))]
        turns = np.array(_ROTATIONS[cell])[rng.integers(len(_ROTATIONS[cell]), size=len(cells))]
        cells = np.take_along_axis(cells, turns, 1)
    return cells.astype(np.int32), positions


SIDES = {
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "square": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tet": list(itertools.combinations(range(4), 3)),
    "cube": [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (3, 2, 6, 7), (0, 3, 7, 4), (1, 2, 6, 5)],
}
EDGES = {
    "tet": list(itertools.combinations(range(4), 2)),
    "cube": [(a + s, (a + 1) % 4 + s) for s in (0, 4) for a in range(4)]
    + [(a, a + 4) for a in range(4)],
}


def entity_sets(cells, places):
    """Vertices of each entity of a list of places in cells, with the cells that have it."""
    found = {}
    for number, cell in enumerate(cells.tolist()):
        for place in places:
            found.setdefault(frozenset(cell[k] for k in place), []).append(number)
    return found
