"""Classes of shape functions by cell and family, under the names of `warp.fem.space.shape`."""

import warp as wp
from warp._src.fem.cells import cell as cells
from warp._src.fem.cells.element import make_element
from warp._src.fem.cells.layout import ElementBasis
from warp._src.fem.cells.polynomial import Polynomial
from warp._src.fem.spaces.shapes import ShapeFunction

_LOBATTO = Polynomial.LOBATTO_GAUSS_LEGENDRE


class _CellShapeFunction(ShapeFunction):
    """Base of the classes: the cell and the family are those of the class."""

    cell = None
    basis = ElementBasis.LAGRANGE

    def __init__(self, degree: int, family: Polynomial = _LOBATTO, scalar_type: type = wp.float32):
        super().__init__(make_element(self.cell, degree, self.basis, family), scalar_type)


class SquareShapeFunction(_CellShapeFunction):
    """Shape functions of squares."""

    cell = cells.SQUARE


class CubeShapeFunction(_CellShapeFunction):
    """Shape functions of cubes."""

    cell = cells.CUBE


class TriangleShapeFunction(_CellShapeFunction):
    """Shape functions of triangles."""

    cell = cells.TRIANGLE


class TetrahedronShapeFunction(_CellShapeFunction):
    """Shape functions of tetrahedra."""

    cell = cells.TET


_LAGRANGE = {
    "Square": "SquareBipolynomial",
    "Cube": "CubeTripolynomial",
    "Triangle": "TrianglePolynomial",
    "Tetrahedron": "TetrahedronPolynomial",
}
_OTHERS = {
    "Serendipity": ElementBasis.SERENDIPITY,
    "NonConformingPolynomial": ElementBasis.NONCONFORMING_POLYNOMIAL,
    "NedelecFirstKind": ElementBasis.NEDELEC_FIRST_KIND,
    "RaviartThomas": ElementBasis.RAVIART_THOMAS,
    "BSpline": ElementBasis.BSPLINE,
}


def _make(name, base, basis):
    text = f"{basis.name.replace('_', ' ').title()} shape functions of a {base.cell}."
    return type(name, (base,), {"basis": basis, "__doc__": text, "__module__": __name__})


for _word, _name in _LAGRANGE.items():
    _base = globals()[f"{_word}ShapeFunction"]
    globals()[f"{_name}ShapeFunctions"] = _make(
        f"{_name}ShapeFunctions", _base, ElementBasis.LAGRANGE
    )
    for _family, _basis in _OTHERS.items():
        if _word in ("Square", "Cube") or _family not in ("Serendipity", "BSpline"):
            _full = f"{_word}{_family}ShapeFunctions"
            globals()[_full] = _make(_full, _base, _basis)
