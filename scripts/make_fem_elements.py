"""Makes the tables of finite elements that basix knows: python scripts/make_fem_elements.py

Writes python/warp/_src/fem/cells/elements.npz: quadrature rules of triangles and tetrahedra. It is
run by hand when a family is added, with `pip install fenics-basix==0.11`; programs need the
written file alone.
"""

import pathlib
from math import factorial

import basix
import numpy as np

OUTPUT = pathlib.Path(__file__).parent.parent / "python/warp/_src/fem/cells/elements.npz"
SIMPLICES = {
    "triangle": (basix.CellType.triangle, 30),
    "tetrahedron": (basix.CellType.tetrahedron, 15),
}


def rules() -> dict:
    """Positive rules with points inside, (q, d + 1) parameters and weights of sum 1, by order.

    An order whose own rule has a weight that is not positive, or a point outside, gets the next.
    """
    tables = {}
    for name, (cell, highest) in SIMPLICES.items():
        kept = None
        for order in range(highest, 1, -1):
            kind = basix.QuadratureType.xiao_gimbutas
            points, weights = basix.make_quadrature(cell, order, rule=kind)
            inside = points.min() > 0.0 and points.sum(axis=1).max() < 1.0
            if inside and weights.min() > 0.0:
                kept = np.column_stack((points, weights * factorial(points.shape[1])))
            tables[f"rule {name} {order}"] = kept
    return tables


def main():
    np.savez_compressed(OUTPUT, **rules())
    print(f"{OUTPUT}: {OUTPUT.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
