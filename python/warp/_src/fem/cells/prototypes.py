"""Kinds of cells - the names that programs compare `geo.reference_cell()` with."""

from warp._src.fem.cells.cell import CUBE, LINE, SQUARE, TET, TRIANGLE


class Element:
    """Reference cells by kind."""

    LINE_SEGMENT = LINE
    SQUARE = SQUARE
    CUBE = CUBE
    TRIANGLE = TRIANGLE
    TETRAHEDRON = TET
