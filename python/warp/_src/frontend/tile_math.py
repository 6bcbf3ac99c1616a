"""Functions of elements, reductions, linear algebra of tiles."""

from __future__ import annotations

from warp._src import errors
from warp._src.frontend.context import FLOAT32, Part
from warp._src.frontend.names import BuiltinRef
from warp._src.kernels.function import Function
from warp._src.types import dtypes

# Functions that reductions know by themselves.
_REDUCTIONS = {"add": "add", "min": "min", "max": "max"}
_PRECISIONS = ("default", "tf32", "tf32x3")


class TileMath(Part):
    """Translates what computes with tiles."""

    @property
    def tiles(self):
        return self.context.tiles

    # Elementwise.

    def function(self, binding, node, name):
        """What a function of elements does with values."""
        if isinstance(binding, BuiltinRef):
            return lambda *values: self.context.calls.apply_builtin(
                binding.name, list(values), node
            )
        if isinstance(binding, Function):
            return lambda *values: self.context.user_calls.call_function(
                binding, list(values), {}, node
            )
        raise self.context.type_error(
            node,
            f"{name}() expects a builtin or a `@wp.func`, but got "
            f"'{self.context.type_name(binding)}'",
        )

    def builtin_tile_map(self, node):
        arguments, keywords = self.context.constructors.arguments(node)
        operation, *operands = (*arguments, *keywords.values())
        values = [self.context.materialize(operand, node) for operand in operands]
        tiles = [value.type for value in values if value.type.kind == "tile"]
        if not tiles:
            raise self.context.type_error(node, "tile_map() expects a tile")
        for other in tiles[1:]:
            if other.shape != tiles[0].shape:
                raise self.context.error(
                    node,
                    f"tile_map() expects tiles of one shape, got {tuple(tiles[0].shape)} and "
                    f"{tuple(other.shape)}",
                    "use `wp.tile_broadcast(...)`",
                    errors.WarpCodegenValueError,
                )
        return self.tiles.mapped(values, self.function(operation, node, "tile_map"), node)

    def builtin_tile_axpy(self, node):
        """`dest += alpha * src`."""
        alpha, source, target = self.tiles.bind(node, "tile_axpy", ("alpha", "src", "dest"))
        source = self.tiles.tile(source, node, "tile_axpy")
        target = self.tiles.tile(target, node, "tile_axpy")
        self.same_shape(source, target, node, "tile_axpy")
        element = source.type.element
        scalar = element.element or element
        alpha = self.context.convert_constant(alpha, scalar, node)

        def step(factor, x, y):
            product = self.builder.builtin("mul", [x, factor])[0][0]
            return self.builder.builtin("add", [y, product])[0][0]

        made = self.tiles.mapped([alpha, source, target], step, node)
        place = node.args[2] if len(node.args) > 2 else node.keywords[-1].value
        self.tiles.write_back(place, made, node)

    def same_shape(self, a, b, node, name):
        if a.type.shape != b.type.shape:
            raise self.context.error(
                node,
                f"{name}() expects tiles of one shape, got {tuple(a.type.shape)} and "
                f"{tuple(b.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )

    # Reductions.

    def axis(self, binding, tile, node, name):
        """A dimension as an int; None for all of them."""
        if binding is None:
            return None
        known = self.tiles.known(binding)
        if not isinstance(known, int) or not 0 <= known < len(tile.type.shape):
            raise self.context.error(
                node,
                f"{name}() axis must be a dimension of the tile, which has "
                f"{len(tile.type.shape)}, got {known}",
                kind=errors.WarpCodegenValueError,
            )
        return known

    def reduced(self, node, name, kind, operation="reduce", numbers=True):
        binding, axis = self.tiles.bind(node, name, ("a", "axis"), axis=None)
        tile = self.tiles.tile(binding, node, name)
        if numbers and tile.type.element.kind not in ("int", "float"):
            raise self.context.type_error(
                node, f"{name}() expects numbers, but got '{tile.type.python_name}'"
            )
        axis = self.axis(axis, tile, node, name)
        return self.tiles.make(operation, [tile], node, kind=kind, axis=axis)[0]

    def builtin_tile_sum(self, node):
        return self.reduced(node, "tile_sum", "add", numbers=False)

    def builtin_tile_min(self, node):
        return self.reduced(node, "tile_min", "min")

    def builtin_tile_max(self, node):
        return self.reduced(node, "tile_max", "max")

    def builtin_tile_argmin(self, node):
        return self.reduced(node, "tile_argmin", "min", "arg_reduce")

    def builtin_tile_argmax(self, node):
        return self.reduced(node, "tile_argmax", "max", "arg_reduce")

    def builtin_tile_dot(self, node):
        """The sum of products of elements; of composites, of their inner products."""
        a, b = self.tiles.bind(node, "tile_dot", ("a", "b"))
        a, b = (self.tiles.tile(one, node, "tile_dot") for one in (a, b))
        self.same_shape(a, b, node, "tile_dot")
        kind = a.type.element.kind
        product = {"vec": "dot", "quat": "dot", "mat": "ddot"}.get(kind, "mul")
        made = self.tiles.mapped(
            [a, b], lambda x, y: self.builder.builtin(product, [x, y])[0][0], node
        )
        return self.tiles.make("reduce", [made], node, kind="add")[0]

    def builtin_tile_reduce(self, node):
        operation, binding, axis = self.tiles.bind(
            node, "tile_reduce", ("op", "a", "axis"), axis=None
        )
        tile = self.tiles.tile(binding, node, "tile_reduce")
        axis = self.axis(axis, tile, node, "tile_reduce")
        known = _REDUCTIONS.get(getattr(operation, "name", None))
        is_number = tile.type.element.kind in ("int", "float")
        if isinstance(operation, BuiltinRef) and known and (known == "add" or is_number):
            return self.tiles.make("reduce", [tile], node, kind=known, axis=axis)[0]
        function = self.function(operation, node, "tile_reduce")
        tiles = self.context.session.tiles
        self.context.at(node)
        result = function(*tiles.begin_function([tile], True))
        return tiles.end_function([self.context.materialize(result, node)], axis=axis)[0]

    def scanned(self, node, name, kind, exclusive=False):
        (binding,) = self.tiles.bind(node, name, ("a",))
        tile = self.tiles.tile(binding, node, name)
        return self.tiles.make("scan", [tile], node, kind=kind, flag=exclusive)[0]

    def builtin_tile_scan_inclusive(self, node):
        return self.scanned(node, "tile_scan_inclusive", "add")

    def builtin_tile_scan_exclusive(self, node):
        return self.scanned(node, "tile_scan_exclusive", "add", True)

    def builtin_tile_scan_max_inclusive(self, node):
        return self.scanned(node, "tile_scan_max_inclusive", "max")

    def builtin_tile_scan_min_inclusive(self, node):
        return self.scanned(node, "tile_scan_min_inclusive", "min")

    def builtin_tile_sort(self, node):
        """Sorts keys, and values along with them, in place."""
        keys, values = self.tiles.bind(node, "tile_sort", ("keys", "values"))
        keys = self.tiles.tile(keys, node, "tile_sort")
        values = self.tiles.tile(values, node, "tile_sort")
        self.same_shape(keys, values, node, "tile_sort")
        positions = self.tiles.make("sort", [keys], node)[0]
        for place, tile in zip(node.args, (keys, values), strict=False):
            sorted_tile = self.tiles.make("gather", [tile, positions], node)[0]
            self.tiles.write_back(place, sorted_tile, node)

    # Linear algebra.

    def builtin_tile_matmul(self, node):
        """`tile_matmul(a, b, out, alpha, beta)`, or `tile_matmul(a, b, alpha)`."""
        arguments, keywords = self.context.constructors.arguments(node)
        is_tile = [getattr(getattr(one, "type", None), "kind", "") == "tile" for one in arguments]
        updates = "out" in keywords or (len(is_tile) > 2 and is_tile[2])
        names = ("a", "b", "out", "alpha", "beta", "precision")
        if not updates:
            names = ("a", "b", "alpha", "precision")
        given = self.tiles.bind(
            node, "tile_matmul", names, alpha=1.0, beta=1.0, precision="default"
        )
        bound = dict(zip(names, given, strict=True))
        if bound["precision"] not in _PRECISIONS:
            raise self.context.error(
                node,
                f"tile_matmul() precision must be one of {', '.join(map(repr, _PRECISIONS))}",
                kind=errors.WarpCodegenValueError,
            )
        a, b = (self.matrix(bound[key], node, "tile_matmul") for key in ("a", "b"))
        if a.type.shape[1] != b.type.shape[0]:
            raise self.context.error(
                node,
                f"tile_matmul(a, b) expects as many columns of 'a' as rows of 'b', got shapes "
                f"{tuple(a.type.shape)} and {tuple(b.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        shape = [a.type.shape[0], b.type.shape[1]]
        element = a.type.element if a.type.element.width >= b.type.element.width else b.type.element
        if not updates:
            return self.product(node, a, b, [], bound, shape, element)
        out = self.matrix(bound["out"], node, "tile_matmul")
        if out.type.shape != shape:
            raise self.context.error(
                node,
                f"tile_matmul(a, b, out) 'out' must have the shape {tuple(shape)}, got "
                f"{tuple(out.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        made = self.product(node, a, b, [out], bound, shape, out.type.element)
        place = node.args[2] if len(node.args) > 2 else _keyword(node, "out")
        self.tiles.write_back(place, made, node)
        return None

    def product(self, node, a, b, out, bound, shape, element):
        def factor(key):
            native = FLOAT32 if element.width == 16 else element
            return self.tiles.convert(bound[key], dtypes.dtype_of(native), node, "tile_matmul")

        operands = [a, b]
        if out or self.tiles.known(bound["alpha"]) != 1:
            operands.append(factor("alpha"))
        if out:
            operands += [*out, factor("beta")]
        return self.tiles.make("matmul", operands, node, shape=shape, element=element)[0]

    def matrix(self, binding, node, name):
        tile = self.tiles.tile(binding, node, name)
        if len(tile.type.shape) != 2 or tile.type.element.kind != "float":
            raise self.context.type_error(
                node, f"{name}() expects 2D tiles of floats, but got '{tile.type.python_name}'"
            )
        return tile

    def square(self, binding, node, name):
        tile = self.matrix(binding, node, name)
        rows, columns = tile.type.shape
        if rows != columns or tile.type.element.width < 32:
            raise self.context.error(
                node,
                f"{name}() expects a square tile of float32 or float64, but got "
                f"'{tile.type.python_name}'",
                kind=errors.WarpCodegenValueError,
            )
        return tile

    def fill_mode(self, binding, node, name):
        """Whether the upper triangle is meant."""
        if binding not in ("lower", "upper"):
            raise self.context.error(
                node,
                f"{name}() fill_mode must be 'lower' or 'upper', got {binding!r}",
                kind=errors.WarpCodegenValueError,
            )
        return binding == "upper"

    def factored(self, node, name):
        matrix, mode = self.tiles.bind(node, name, ("A", "fill_mode"), fill_mode="lower")
        upper = self.fill_mode(mode, node, name)
        return self.tiles.make("cholesky", [self.square(matrix, node, name)], node, flag=upper)[0]

    def builtin_tile_cholesky(self, node):
        return self.factored(node, "tile_cholesky")

    def builtin_tile_cholesky_inplace(self, node):
        made = self.factored(node, "tile_cholesky_inplace")
        self.tiles.write_back(node.args[0], made, node)

    def solved(self, node, name, names, steps):
        """Solves with a triangle, or with it and its transpose.

        steps: (upper, transposed) of each; None stands for a Cholesky factor.
        """
        defaults = {"fill_mode": "lower"} if steps is None else {}
        matrix, rhs, *mode = self.tiles.bind(node, name, names, **defaults)
        matrix = self.square(matrix, node, name)
        rhs = self.tiles.tile(rhs, node, name)
        if (
            len(rhs.type.shape) > 2
            or rhs.type.shape[0] != matrix.type.shape[0]
            or rhs.type.element != matrix.type.element
        ):
            raise self.context.error(
                node,
                f"{name}() expects a right side with {matrix.type.shape[0]} rows of "
                f"'{matrix.type.element.python_name}', but got '{rhs.type.python_name}'",
                kind=errors.WarpCodegenValueError,
            )
        if steps is None:
            upper = self.fill_mode(mode[0], node, name)
            steps = ((upper, upper), (upper, not upper))
        for upper, transposed in steps:
            rhs = self.tiles.make("solve", [matrix, rhs], node, flag=upper, transposed=transposed)[
                0
            ]
        return rhs

    def builtin_tile_cholesky_solve(self, node):
        return self.solved(node, "tile_cholesky_solve", ("L", "y", "fill_mode"), None)

    def builtin_tile_cholesky_solve_inplace(self, node):
        name = "tile_cholesky_solve_inplace"
        made = self.solved(node, name, ("L", "y", "fill_mode"), None)
        self.tiles.write_back(node.args[1], made, node)

    def builtin_tile_lower_solve(self, node):
        return self.solved(node, "tile_lower_solve", ("L", "y"), ((False, False),))

    def builtin_tile_lower_solve_inplace(self, node):
        made = self.solved(node, "tile_lower_solve_inplace", ("L", "y"), ((False, False),))
        self.tiles.write_back(node.args[1], made, node)

    def builtin_tile_upper_solve(self, node):
        return self.solved(node, "tile_upper_solve", ("U", "z"), ((True, False),))

    def builtin_tile_upper_solve_inplace(self, node):
        made = self.solved(node, "tile_upper_solve_inplace", ("U", "z"), ((True, False),))
        self.tiles.write_back(node.args[1], made, node)

    def builtin_tile_diag_add(self, node):
        matrix, diagonal = self.tiles.bind(node, "tile_diag_add", ("a", "d"))
        matrix = self.tiles.tile(matrix, node, "tile_diag_add")
        diagonal = self.tiles.tile(diagonal, node, "tile_diag_add")
        rows = matrix.type.shape
        if len(rows) != 2 or rows[0] != rows[1] or diagonal.type.shape != rows[:1]:
            raise self.context.error(
                node,
                f"tile_diag_add() expects a square tile and its diagonal, but got shapes "
                f"{tuple(rows)} and {tuple(diagonal.type.shape)}",
                kind=errors.WarpCodegenValueError,
            )
        return self.tiles.make("diag_add", [matrix, diagonal], node)[0]

    def transformed(self, node, name, inverse):
        (binding,) = self.tiles.bind(node, name, ("inout",))
        tile = self.tiles.tile(binding, node, name)
        element = tile.type.element
        if element.kind != "vec" or element.shape != [2] or element.element.kind != "float":
            raise self.context.type_error(
                node,
                f"{name}() expects complex numbers, vectors of two floats, but got "
                f"'{tile.type.python_name}'",
            )
        made = self.tiles.make("fft", [tile], node, flag=inverse)[0]
        self.tiles.write_back(node.args[0], made, node)

    def builtin_tile_fft(self, node):
        self.transformed(node, "tile_fft", False)

    def builtin_tile_ifft(self, node):
        self.transformed(node, "tile_ifft", True)


def _keyword(node, name):
    return next(one.value for one in node.keywords if one.arg == name)
