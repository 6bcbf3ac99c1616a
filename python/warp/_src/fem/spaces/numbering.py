"""Node numbering - tables of the nodes of each cell, from the entities of a geometry.

Nodes of an entity follow each other and have one order for all cells of the entity: that of its
vertices sorted by number. Turns of the layout say which place and sign that gives to the nodes of
a cell whose own order is another.
"""

import functools
import itertools
import math
from dataclasses import dataclass

import numpy as np

import warp as wp
from warp._src.fem.cells.cell import SQUARE
from warp._src.fem.cells.tables import table
from warp._src.fem.types import IntTable, Pairs


@dataclass(frozen=True)
class Entities:
    """Numbers of the vertices, edges and faces of each cell.

    Attributes:
        cell_vertices, cell_edges, cell_faces: int32 (cells, n) in the reference cell's order.
        vertex_count, edge_count, face_count: of the whole geometry.
        aligned: edges and faces have the same direction in all their cells.
        side_ends: int32 vectors; the first is `cell * sides + place` of a cell with the side.
    """

    cell_vertices: object
    cell_edges: object
    cell_faces: object
    vertex_count: int
    edge_count: int
    face_count: int
    aligned: bool = False
    side_ends: object = None


def grid_entities(res, device) -> Entities:
    """Entities of one environment of a regular grid.

    Vertices have the last axis fastest; edges are numbered by axis and faces by normal, the place
    along that axis first and the others in cyclic order.
    """
    dimension = len(res)
    places = np.stack(np.meshgrid(*map(np.arange, res), indexing="ij"), axis=-1)
    places = places.reshape(-1, dimension)
    cyclic = [[(axis + k) % dimension for k in range(dimension)] for axis in range(dimension)]

    def numbers(first, order, sizes, offset):
        at = 0
        for axis in order:
            at = at * sizes[axis] + places[:, axis] + offset[axis]
        return first + at

    def along(axis, values):
        return {cyclic[axis][k]: value for k, value in enumerate(values)}

    def family(sizes_of, offsets_of):
        """Numbers of the entities of all axes, and their count in one environment."""
        columns, first = [], 0
        for axis in range(dimension):
            sizes = sizes_of(axis)
            for offset in offsets_of:
                columns.append(numbers(first, cyclic[axis], sizes, along(axis, offset)))
            first += math.prod(sizes)
        return columns, first

    def edge_sizes(axis):
        return [n + (k != axis) for k, n in enumerate(res)]

    def face_sizes(axis):
        return [n + (k == axis) for k, n in enumerate(res)]

    shape = [n + 1 for n in res]
    corners = itertools.product((0, 1), repeat=dimension)
    vertices = [numbers(0, range(dimension), shape, corner) for corner in corners]
    offsets = [(0, *ends) for ends in itertools.product((0, 1), repeat=dimension - 1)]
    if dimension == 3:
        edges, edge_count = family(edge_sizes, offsets)
        faces, face_count = family(face_sizes, [(0, 0, 0), (1, 0, 0)])
    else:
        # Edges of a plane grid have the numbers of its sides: by normal.
        edges, edge_count = family(face_sizes, [(0, 0), (1, 0)])
        edges, faces, face_count = edges[2:] + edges[:2], [], 0

    def array(columns):
        if not columns:
            return wp.empty((0, 0), dtype=wp.int32, device=device)
        return wp.array(np.stack(columns, axis=1).astype(np.int32), device=device)

    arrays = [array(columns) for columns in (vertices, edges, faces)]
    return Entities(*arrays, math.prod(shape), edge_count, face_count, aligned=True)


@functools.cache
def _turns(cell):
    """Functions of kernels of (vertices, element, edge or face): the order of its vertices."""
    edge_ends = table(np.array(cell.edges), wp.int32)
    corners = table(np.array(cell.faces or ((0, 0, 0, 0),)), wp.int32)

    @wp.func
    def edge_turn(vertices: IntTable, element: int, edge: int):
        first = vertices[element, edge_ends[edge, 0]]
        return wp.where(first > vertices[element, edge_ends[edge, 1]], 1, 0)

    @wp.func
    def triangle_turn(vertices: IntTable, element: int, face: int):
        a = vertices[element, corners[face, 0]]
        b = vertices[element, corners[face, 1]]
        c = vertices[element, corners[face, 2]]
        if a < b and a < c:
            return wp.where(b > c, 1, 0)
        if b < a and b < c:
            return wp.where(c > a, 3, 2)
        return wp.where(a > b, 5, 4)

    @wp.func
    def square_turn(vertices: IntTable, element: int, face: int):
        least = int(0)
        for v in range(1, 4):
            here = vertices[element, corners[face, v]]
            if here < vertices[element, corners[face, least]]:
                least = v
        across = vertices[element, corners[face, least ^ 2]]
        beside = vertices[element, corners[face, least ^ 1]]
        return 2 * least + wp.where(across > beside, 1, 0)

    return edge_turn, triangle_turn if cell.is_simplex else square_turn


@functools.cache
def _place_of_entity(cell, layout, aligned: bool, dimension: int):
    """A function of kernels of (vertices, ends of sides, entity, element, its number in the
    element, place in it): the place and the sign of a node of an edge or face."""
    turns = (layout.edge_turns, layout.face_turns)[dimension - 1]
    numbers, signs = _turn_tables(turns)
    turn_of, sides = _turns(cell)[dimension - 1], len(cell.sides)
    side_signs = table(np.array(layout.side_signs or (1,)), wp.int32)
    across = len(layout.side_signs) > 0 and dimension == cell.dimension - 1

    @wp.func
    def place_of(
        vertices: IntTable, ends: Pairs, entity: int, element: int, number: int, place: int
    ):
        turn = int(0)
        sign = int(1)
        if wp.static(not aligned):
            turn = turn_of(vertices, element, number)
            sign = signs[turn, place]
        if wp.static(across and not aligned):
            # Out of the first cell of the side.
            is_first = ends[entity][0] == element * sides + number
            sign = wp.where(is_first, side_signs[number], -side_signs[number])
        return numbers[turn, place], sign

    return place_of


@functools.cache
def numbering_kernel(cell, layout, aligned: bool):
    """The kernel that writes numbers and signs of the nodes of cells."""
    entities = np.array(layout.entities)
    kinds, numbers, places = (table(entities[:, k], wp.int32) for k in range(3))
    of_vertices, of_edges, of_faces, of_cells = layout.counts
    has_edges, has_faces = of_edges > 0 and cell.dimension > 1, of_faces > 0 and cell.dimension > 2
    of_edge = _place_of_entity(cell, layout, aligned, 1) if has_edges else None
    of_face = _place_of_entity(cell, layout, aligned, 2) if has_faces else None

    @wp.kernel(enable_backward=False)
    def number_nodes(
        vertices: IntTable,
        edges: IntTable,
        faces: IntTable,
        ends: Pairs,
        first_edge: int,
        first_face: int,
        first_cell: int,
        nodes: IntTable,
        signs: wp.array2d(dtype=wp.int8),
    ):
        element, k = wp.tid()
        kind = kinds[k]
        number = numbers[k]
        place = places[k]
        sign = int(1)
        node = first_cell + element * of_cells + place
        if kind == 0:
            node = vertices[element, number] * of_vertices + place
        if wp.static(has_edges):
            if kind == 1:
                edge = edges[element, number]
                place, sign = of_edge(vertices, ends, edge, element, number, place)
                node = first_edge + edge * of_edges + place
        if wp.static(has_faces):
            if kind == 2:
                face = faces[element, number]
                place, sign = of_face(vertices, ends, face, element, number, place)
                node = first_face + face * of_faces + place
        nodes[element, k] = node
        signs[element, k] = wp.int8(sign)

    return number_nodes


def _turn_tables(turns):
    turns = turns or (((0,), (1,)),)
    return (table(np.array([turn[k] for turn in turns]), wp.int32) for k in range(2))


def mesh_entities(entities, element, room: int = 0) -> Entities:
    """Entities of a mesh or sparse grid; the ones without nodes are not asked for.

    Args:
        room: cells that a sparse grid has room for, so that numbers stay in place; else 0.
    """
    layout, edges, faces = element.layout, None, None
    edge_count = face_count = 0
    if layout.counts[1]:
        edges = entities.cell_edges
        edge_count = room * len(element.cell.edges) or entities.edge_count
    if layout.counts[2]:
        faces = entities.cell_faces
        face_count = room * len(element.cell.faces) or entities.face_count
    ends = None
    if layout.side_signs and not entities.aligned:
        ends = entities.sides.ends
    counts = (entities.vertex_count, edge_count, face_count)
    return Entities(entities.cells, edges, faces, *counts, entities.aligned, ends)


def firsts(element, entities: Entities, cells: int) -> tuple:
    """First node of edges, of faces, of the cells, and the number of nodes. Nodes of squares come
    before the ones of edges."""
    of_vertices, of_edges, of_faces, of_cells = element.layout.counts
    vertices = entities.vertex_count * of_vertices
    edges = entities.edge_count * of_edges if element.cell.dimension > 1 else 0
    faces = entities.face_count * of_faces if element.cell.dimension > 2 else 0
    inside = cells * of_cells
    total = vertices + edges + faces + inside
    if element.cell == SQUARE:
        return vertices + inside, total, vertices, total
    return vertices, vertices + edges, vertices + edges + faces, total


def number_nodes(element, entities: Entities, cells: int, device, out=None) -> tuple:
    """Nodes of each cell.

    Args:
        out: arrays of numbers and signs to fill, if they have the size.

    Returns:
        Numbers (cells, n) int32, signs (cells, n) int8, None if nodes are vertices, and the number
        of nodes.

    Raises:
        ValueError: there are 2^31 nodes or more.
    """
    first_edge, first_face, first_cell, total = firsts(element, entities, cells)
    if total >= 2**31:
        raise ValueError(f"expects fewer than 2^31 nodes, but {element!r} has {total}")
    shape = (cells, element.node_count)
    if element.layout.entities == tuple((0, k, 0) for k in range(len(element.cell.vertices))):
        # The nodes are the vertices.
        vertices = entities.cell_vertices.to(device)
        if out is None or out[0].shape != shape:
            return vertices, None, total
        wp.copy(out[0], vertices)
        return out[0], None, total
    if out is None or out[0].shape != shape:
        out = (wp.empty(shape, wp.int32, device), wp.empty(shape, wp.int8, device))
    nodes, signs = out
    arrays = [entities.cell_vertices, entities.cell_edges, entities.cell_faces]
    arrays = [
        wp.empty((0, 0), dtype=wp.int32, device=device) if array is None else array.to(device)
        for array in arrays
    ]
    ends = entities.side_ends
    ends = wp.empty(0, dtype=wp.vec2i, device=device) if ends is None else ends.to(device)
    kernel = numbering_kernel(element.cell, element.layout, entities.aligned)
    inputs = [*arrays, ends, first_edge, first_face, first_cell, nodes, signs]
    wp.launch(kernel, shape, inputs, device=device)
    return nodes, signs, total
