"""Orders of vertices - which of the orders of its vertices' numbers a cell has."""

import itertools

import numpy as np

import warp as wp


def cell_orientations(base, device):
    """For each cell of a mesh of simplices the place of the ranks of its vertices among all
    permutations in lexicographic order, int32 (cells,)."""
    cells = base.entities(device).cells.numpy()
    ranks = np.argsort(np.argsort(cells, axis=1), axis=1)
    size = cells.shape[1]
    codes = ranks @ size ** np.arange(size)
    orders = np.array(list(itertools.permutations(range(size))))
    places = np.zeros(size**size, np.int32)
    places[orders @ size ** np.arange(size)] = np.arange(len(orders), dtype=np.int32)
    return wp.array(places[codes], dtype=wp.int32, device=device)
