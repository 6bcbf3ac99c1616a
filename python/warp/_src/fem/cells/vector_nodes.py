"""Nodes of vector families - weights, signs and turns that cells of all shapes share."""

from __future__ import annotations

import numpy as np


def equal_weights(element, entities):
    """Weights of nodes over the cell and over each of its sides."""
    count = len(entities)
    side = element.cell.dimension - 1
    on_side = sum(1 for e in entities if e[0] == side and e[1] == 0)
    if side == 2:
        vertices = set(element.cell.faces[0])
        edges = [k for k, e in enumerate(element.cell.edges) if vertices.issuperset(e)]
        on_side += sum(1 for e in entities if e[0] == 1 and e[1] in edges)
    traces = [1.0 / on_side if e[0] <= side else 0.0 for e in entities]
    return np.full(count, 1.0 / count), np.array(traces)


def side_signs(cell, entities, places, directions):
    """1 for the sides whose nodes have directions out of the cell, -1 for others."""
    signs, center = {}, cell.vertices.mean(axis=0)
    for entity, place, direction in zip(entities, places, directions, strict=True):
        if entity[0] == cell.dimension - 1:
            signs[entity[1]] = 1 if direction @ (place - center) > 0.0 else -1
    return tuple(signs[k] for k in range(len(signs)))


def edge_turns(degree, sign) -> tuple:
    """Turns of nodes that lie symmetrically along edges."""
    along = tuple(range(degree))
    return (along, (1,) * degree), (along[::-1], (sign,) * degree)
