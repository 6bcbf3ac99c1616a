"""Linear algebra of tiles: products, factors, solves, Fourier transforms."""

from __future__ import annotations

from warp._src.frontend.bindings import FLOAT32
from warp._src.frontend.tiles.arguments import TileTopic
from warp._src.types import dtypes

_PRECISIONS = ("default", "tf32", "tf32x3")
# Parameters of solves, and the triangle and transposition of each of their steps; None stands for
# both steps with a Cholesky factor.
_WITH_FACTOR = (("L", "y", "fill_mode"), None)
_WITH_LOWER = (("L", "y"), ((False, False),))
_WITH_UPPER = (("U", "z"), ((True, False),))


class TileAlgebra(TileTopic):
    """Translates what takes tiles for matrices."""

    def builtin_tile_matmul(self, node):
        """`tile_matmul(a, b, out, alpha, beta)`, or `tile_matmul(a, b, alpha)`."""
        arguments, keywords = self.context.constructors.arguments(node)
        is_tile = [getattr(getattr(one, "type", None), "kind", "") == "tile" for one in arguments]
        updates = "out" in keywords or (len(is_tile) > 2 and is_tile[2])
        names = ("a", "b", "out", "alpha", "beta", "precision")
        if not updates:
            names = ("a", "b", "alpha", "precision")
        given = self.bind(node, "tile_matmul", names, alpha=1.0, beta=1.0, precision="default")
        bound = dict(zip(names, given, strict=True))
        if bound["precision"] not in _PRECISIONS:
            raise self.context.value_error(
                node,
                f"tile_matmul() precision must be one of {', '.join(map(repr, _PRECISIONS))}",
                also="precision must be the string literal 'default' or 'tf32'",
            )
        a, b = (self.matrix(bound[key], node, "tile_matmul") for key in ("a", "b"))
        if bound["precision"] != "default" and a.type.element != FLOAT32:
            raise self.context.type_error(
                node,
                f"tile_matmul() precision='{bound['precision']}' requires float32 tiles, got "
                f"{a.type.element.python_name}",
            )
        if a.type.shape[1] != b.type.shape[0]:
            raise self.context.value_error(
                node,
                f"tile_matmul(a, b) expects as many columns of 'a' as rows of 'b', got shapes "
                f"{tuple(a.type.shape)} and {tuple(b.type.shape)}",
            )
        shape = [a.type.shape[0], b.type.shape[1]]
        element = a.type.element if a.type.element.width >= b.type.element.width else b.type.element
        if not updates:
            return self.product(node, a, b, [], bound, shape, element)
        out = self.matrix(bound["out"], node, "tile_matmul")
        if out.type.shape != shape:
            raise self.context.value_error(
                node,
                f"tile_matmul(a, b, out) 'out' must have the shape {tuple(shape)}, got "
                f"{tuple(out.type.shape)}",
            )
        # Times zero, even what is no number does not count.
        kept = [] if self.known(bound["beta"]) == 0 else [out]
        made = self.product(node, a, b, kept, bound, shape, out.type.element)
        by_name = (one.value for one in node.keywords if one.arg == "out")
        place = node.args[2] if len(node.args) > 2 else next(by_name)
        self.context.slots.write_back(place, made, node)
        return None

    def product(self, node, a, b, out, bound, shape, element):
        def factor(key):
            native = FLOAT32 if element.width == 16 else element
            return self.convert(bound[key], dtypes.dtype_of(native), node, "tile_matmul")

        operands = [a, b]
        if out or self.known(bound["alpha"]) != 1:
            operands.append(factor("alpha"))
        if out:
            operands += [*out, factor("beta")]
        return self.make("matmul", operands, node, shape=shape, element=element)

    def matrix(self, binding, node, name):
        tile = self.tile(binding, node, name)
        if len(tile.type.shape) != 2 or tile.type.element.kind != "float":
            raise self.context.type_error(
                node,
                f"{name}() expects 2D tiles of floats, but got '{tile.type.python_name}'",
                also=f"{name}() does not support complex tiles",
            )
        return tile

    def square(self, binding, node, name):
        tile = self.matrix(binding, node, name)
        rows, columns = tile.type.shape
        if rows != columns or tile.type.element.width < 32:
            raise self.context.value_error(
                node,
                f"{name}() expects a square tile of float32 or float64, but got "
                f"'{tile.type.python_name}'",
            )
        return tile

    def fill_mode(self, binding, node, name):
        """Whether the upper triangle is meant."""
        if binding not in ("lower", "upper"):
            raise self.context.value_error(
                node,
                f"{name}() fill_mode must be 'lower' or 'upper', got {binding!r}",
            )
        return binding == "upper"

    def factored(self, node, name):
        matrix, mode = self.bind(node, name, ("A", "fill_mode"), fill_mode="lower")
        upper = self.fill_mode(mode, node, name)
        return self.make("cholesky", [self.square(matrix, node, name)], node, flag=upper)

    def builtin_tile_cholesky(self, node):
        return self.factored(node, "tile_cholesky")

    def builtin_tile_cholesky_inplace(self, node):
        made = self.factored(node, "tile_cholesky_inplace")
        self.context.slots.write_back(node.args[0], made, node)

    def solved(self, node, name, names, steps):
        """Solves with a triangle, or with it and its transpose.

        steps: (upper, transposed) of each; None stands for a Cholesky factor.
        """
        defaults = {"fill_mode": "lower"} if steps is None else {}
        matrix, rhs, *mode = self.bind(node, name, names, **defaults)
        matrix = self.square(matrix, node, name)
        rhs = self.tile(rhs, node, name)
        if (
            len(rhs.type.shape) > 2
            or rhs.type.shape[0] != matrix.type.shape[0]
            or rhs.type.element != matrix.type.element
        ):
            raise self.context.value_error(
                node,
                f"{name}() expects a right side with {matrix.type.shape[0]} rows of "
                f"'{matrix.type.element.python_name}', but got '{rhs.type.python_name}'",
            )
        if steps is None:
            upper = self.fill_mode(mode[0], node, name)
            steps = ((upper, upper), (upper, not upper))
        for upper, transposed in steps:
            rhs = self.make("solve", [matrix, rhs], node, flag=upper, transposed=transposed)
        return rhs

    def solved_in_place(self, node, name, names, steps):
        made = self.solved(node, name, names, steps)
        self.context.slots.write_back(node.args[1], made, node)

    def builtin_tile_cholesky_solve(self, node):
        return self.solved(node, "tile_cholesky_solve", *_WITH_FACTOR)

    def builtin_tile_cholesky_solve_inplace(self, node):
        self.solved_in_place(node, "tile_cholesky_solve_inplace", *_WITH_FACTOR)

    def builtin_tile_lower_solve(self, node):
        return self.solved(node, "tile_lower_solve", *_WITH_LOWER)

    def builtin_tile_lower_solve_inplace(self, node):
        self.solved_in_place(node, "tile_lower_solve_inplace", *_WITH_LOWER)

    def builtin_tile_upper_solve(self, node):
        return self.solved(node, "tile_upper_solve", *_WITH_UPPER)

    def builtin_tile_upper_solve_inplace(self, node):
        self.solved_in_place(node, "tile_upper_solve_inplace", *_WITH_UPPER)

    def builtin_tile_diag_add(self, node):
        matrix, diagonal = self.bind(node, "tile_diag_add", ("a", "d"), tiles=2)
        rows = matrix.type.shape
        if len(rows) != 2 or rows[0] != rows[1] or diagonal.type.shape != rows[:1]:
            raise self.context.value_error(
                node,
                f"tile_diag_add() expects a square tile and its diagonal, but got shapes "
                f"{tuple(rows)} and {tuple(diagonal.type.shape)}",
            )
        return self.make("diag_add", [matrix, diagonal], node)

    def transformed(self, node, name, inverse):
        (tile,) = self.bind(node, name, ("inout",), tiles=1)
        element = tile.type.element
        if element.kind != "vec" or element.shape != [2] or element.element.kind != "float":
            raise self.context.type_error(
                node,
                f"{name}() expects complex numbers, vectors of two floats, but got "
                f"'{tile.type.python_name}'",
            )
        made = self.make("fft", [tile], node, flag=inverse)
        self.context.slots.write_back(node.args[0], made, node)

    def builtin_tile_fft(self, node):
        self.transformed(node, "tile_fft", False)

    def builtin_tile_ifft(self, node):
        self.transformed(node, "tile_ifft", True)
