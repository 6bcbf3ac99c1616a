"""Kinds of cells - the names that programs compare `geo.reference_cell()` with."""

from warp._src.fem.cells.cell import CUBE, LINE, SQUARE, TET, TRIANGLE, Cell


class Element:
    """Reference cells by kind."""

    LINE_SEGMENT = LINE
    SQUARE = SQUARE
    CUBE = CUBE
    TRIANGLE = TRIANGLE
    TETRAHEDRON = TET


class Prototype:
    """The unit cell of a kind, as programs ask for it: `cell.prototype`."""

    def __init__(self, cell: Cell):
        self.cell = cell

    def measure(self) -> float:
        """Length, area or volume."""
        return self.cell.measure

    def instantiate_quadrature(self, order: int, family=None) -> tuple:
        """Coordinates and weights of the points of a rule."""
        import warp as wp
        from warp._src.fem.cells.rules import rule

        found = rule(self.cell, order, family)
        return [wp.vec3(*point) for point in found.points.tolist()], found.weights.tolist()
