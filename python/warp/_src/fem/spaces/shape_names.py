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


def _make(name: str, base, text: str, **more):
    """Adds a class to the module; gives it."""
    made = type(name, (base,), {"__doc__": text, "__module__": __name__, **more})
    return globals().setdefault(name, made)


for _word, _name in _LAGRANGE.items():
    _cell = cells.cell(_word.lower())
    _base = _make(
        f"{_word}ShapeFunction", _CellShapeFunction, f"Shape functions of a {_cell}.", cell=_cell
    )
    for _family, _basis in {_name: ElementBasis.LAGRANGE, **_OTHERS}.items():
        if _word in ("Square", "Cube") or _family not in ("Serendipity", "BSpline"):
            _text = f"{_basis.name.replace('_', ' ').title()} shape functions of a {_cell}."
            _full = f"{'' if _family == _name else _word}{_family}ShapeFunctions"
            _make(_full, _base, _text, basis=_basis)
