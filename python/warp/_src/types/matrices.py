"""Matrix types: the factory and their behaviour at Python scope. Storage is row-major."""

from __future__ import annotations

import operator
import typing

from warp._src import arguments, errors
from warp._src.types.composites import (
    Composite,
    Products,
    canonical_class,
    construct_components,
    family_error,
    flatten_numbers,
    is_number,
    operand_error,
    scalars_of,
)
from warp._src.types.scalars import canonical_scalar, float_base, shown_name
from warp._src.types.vectors import (
    MOST_COMPONENTS,
    SUFFIX,
    GenericAnnotation,
    Quaternion,
    Vector,
    _cache,
    is_open,
    make_composite,
    unwrapped,
    vector,
)

# Rows and columns of matrices whose products are made by kernels.
_SMALL = 6


class Matrix(Composite):
    """Mixin of matrices; `wp.types.matrix` makes the classes. Also the generic annotation."""

    __slots__ = ()
    _wp_generic_type_str_ = "mat_t"
    _wp_constructor_ = "matrix"

    def __init__(self, *args):
        if not args:
            return
        if not self._shape_:
            raise family_error(type(self))
        rows = self._shape_[0]
        if len(args) == rows and not any(map(is_number, args)):
            columns = self._shape_[1]
            for row in args:
                if hasattr(row, "__len__") and len(row) != columns:
                    raise errors.WarpRowError(
                        f"expects rows of {columns} components for '{shown_name(type(self))}', but "
                        f"got {len(row)}",
                        code="matrix-row",
                        facts={"columns": columns, "row": row},
                    )
            args = ([number for row in args for number in self._row_numbers(row)],)
        construct_components(self, args)

    def __class_getitem__(cls, params):
        params = unwrapped(params)
        if len(params) != 3:
            raise TypeError(
                f"Matrix[...] requires 3 parameters, dtype, rows and columns, but got {len(params)}"
            )
        extents = tuple(p for p in params if isinstance(p, int))
        dtypes = [p for p in params if not isinstance(p, int)]
        if len(extents) == 2 and len(dtypes) == 1:
            try:
                return matrix(extents, dtypes[0])
            except TypeError:
                pass
        return GenericAnnotation(cls, params)

    def __len__(self):
        return self._shape_[0]

    def __iter__(self):
        return (self.get_row(row) for row in range(self._shape_[0]))

    def __str__(self):
        numbers, (count, columns) = scalars_of(self), self._shape_
        rows = (numbers[i * columns : (i + 1) * columns] for i in range(count))
        return "[" + ",\n ".join(f"[{', '.join(map(str, row))}]" for row in rows) + "]"

    def __repr__(self):
        return f"{shown_name(type(self))}({str(self)[1:-1]})".replace("\n", "")

    def get_row(self, r):
        """Copy of a row, as a vector."""
        return self[r]

    def get_col(self, c):
        """Copy of a column, as a vector."""
        return self[:, c]

    def set_row(self, r, v):
        """Sets row `r`, counted from the end if negative."""
        self[r] = v

    def set_col(self, c, v):
        """Sets column `c`, counted from the end if negative."""
        self[:, c] = v

    def __getitem__(self, key):
        rows, columns = self._select(key)
        stride = self._shape_[1]
        if isinstance(rows, int) and isinstance(columns, int):
            return self._get(rows * stride + columns)
        numbers = scalars_of(self)
        row_list = [rows] if isinstance(rows, int) else rows
        column_list = [columns] if isinstance(columns, int) else columns
        picked = [numbers[r * stride + c] for r in row_list for c in column_list]
        if isinstance(rows, int) or isinstance(columns, int):
            return vector(len(picked), self._wp_scalar_type_)._from_numbers(picked)
        shape = (len(row_list), len(column_list)) if picked else (0, 0)
        return matrix(shape, self._wp_scalar_type_)._from_numbers(picked)

    def __setitem__(self, key, value):
        rows, columns = self._select(key)
        row_list = [rows] if isinstance(rows, int) else list(rows)
        column_list = [columns] if isinstance(columns, int) else list(columns)
        count = len(row_list) * len(column_list)
        numbers = self._numbers_of(value, count)
        stride = self._shape_[1]
        targets = (r * stride + c for r in row_list for c in column_list)
        for index, number in zip(targets, numbers, strict=True):
            self._set(index, number)

    def __mul__(self, other):
        if isinstance(other, Matrix):
            return self._product(other)
        if isinstance(other, Vector) and not isinstance(other, Quaternion):
            self._check(other, self._shape_[1] == other._length_)
            if self._is_small():
                return Products.multiply(self, other)
            rows = _rows(self)
            values = scalars_of(other)
            return _vector_like(other, [_dot(row, values) for row in rows])
        return Composite.__mul__(self, other)

    def __matmul__(self, other):
        if isinstance(other, (Matrix, Vector)):
            return self * other
        return NotImplemented

    def _left_multiply(self, values):
        self._check(values, self._shape_[0] == values._length_, swapped=True)
        if self._is_small():
            return Products.multiply(values, self)
        numbers = scalars_of(values)
        return _vector_like(
            values, [_dot(column, numbers) for column in zip(*_rows(self), strict=True)]
        )

    def _product(self, other):
        self._check(other, self._shape_[1] == other._shape_[0])
        if self._is_small() and other._is_small():
            return Products.multiply(self, other)
        columns = list(zip(*_rows(other), strict=True))
        numbers = [_dot(row, column) for row in _rows(self) for column in columns]
        cls = matrix((self._shape_[0], other._shape_[1]), self._wp_scalar_type_)
        return cls._from_numbers(numbers)

    def _check(self, other, fits, swapped=False):
        if not fits or other._wp_scalar_type_ is not self._wp_scalar_type_:
            raise operand_error("mul", *((other, self) if swapped else (self, other)))

    def _is_small(self) -> bool:
        """True if a product is to be made as kernels make it; others would take long to compile."""
        is_float = issubclass(self._wp_scalar_type_, float_base)
        return is_float and self._length_ > 0 and max(self._shape_) <= _SMALL

    def _row_numbers(self, row):
        numbers = flatten_numbers(row)
        if len(numbers) != self._shape_[1]:
            raise ValueError(
                f"expects rows of {self._shape_[1]} components for '{shown_name(type(self))}', "
                f"but got {len(numbers)}"
            )
        return numbers

    def _select(self, key):
        """Rows and columns named by a key: an index or a range each."""
        keys = key if isinstance(key, tuple) else (key, slice(None))
        if len(keys) != 2:
            raise errors.WarpKeyError(
                f"expects 1 or 2 indices for a matrix, but got {len(keys)}",
                code="matrix-index-count",
                facts={"count": len(keys)},
            )
        return tuple(map(_resolve, keys, self._shape_, ("row", "column")))


def _resolve(key, extent, what):
    if isinstance(key, slice):
        try:
            return range(extent)[key]
        except (TypeError, ValueError) as problem:
            raise errors.WarpArgumentError(f"{what} index: {problem}") from None
    try:
        index = operator.index(key)
    except TypeError:
        spelled = (
            repr(key) if isinstance(key, (str, float)) or key is None else arguments.shown(key)
        )
        raise errors.WarpKeyError(
            f"expects an int or a slice as {what} index, but got '{type(key).__name__}'",
            code="matrix-index-type",
            facts={"spelled": spelled},
        ) from None
    if not -extent <= index < extent:
        raise errors.WarpIndexError(
            f"{what} index {index} is out of range for extent {extent}",
            code="matrix-index",
            facts={"what": what},
        )
    return index % extent


def _text(shape) -> str:
    numbers = isinstance(shape, (tuple, list)) and all(type(n) is int for n in shape)
    return repr(shape) if numbers or shape is None else arguments.shown(shape)


def _rows(m):
    numbers, columns = scalars_of(m), m._shape_[1]
    return [numbers[i : i + columns] for i in range(0, m._length_, columns)]


def _dot(a, b):
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total += x * y
    return total


def _vector_like(value, numbers):
    if len(numbers) == value._length_:
        return canonical_class(type(value))._from_numbers(numbers)
    return vector(len(numbers), value._wp_scalar_type_)._from_numbers(numbers)


def matrix(shape=None, dtype=None, *, name=None) -> typing.Any:
    """The matrix type of `shape` (rows, columns) and scalar type `dtype`.

    Raises:
        ValueError: the shape has not two extents, or one is negative.
    """
    if not isinstance(shape, (tuple, list)) or len(shape) != 2:
        rank = len(shape) if isinstance(shape, (tuple, list)) else 0
        extents = f"{rank} dimension{'' if rank == 1 else 's'}"
        raise errors.WarpShapeError(
            f"expects a matrix shape of two extents, but got {_text(shape)}",
            code="matrix-rank",
            facts={"extents": extents, "shape": _text(shape)},
        )
    rows, columns = shape
    if is_open(rows) or is_open(columns) or is_open(dtype):
        return GenericAnnotation(Matrix, (rows, columns, dtype))
    try:
        rows, columns = operator.index(rows), operator.index(columns)
    except TypeError:
        got = " and ".join(map(arguments.shown, shape))
        raise errors.WarpArgumentError(
            f"expects integers as extents of a matrix, but got {got}"
        ) from None
    if min(rows, columns) < 0:
        raise ValueError(f"expects matrix extents of at least 0, but got {tuple(shape)}")
    if rows * columns > MOST_COMPONENTS:
        raise ValueError(
            f"expects at most {MOST_COMPONENTS} components of a matrix, but got "
            f"{arguments.shown(rows)} by {arguments.shown(columns)}"
        )
    dtype = canonical_scalar(dtype)
    key = (Matrix, rows, columns, dtype)
    if key not in _cache:
        attributes = {
            "__doc__": f"{rows} rows of {columns} numbers of type {dtype.__name__}.",
            "_shape_": (rows, columns),
            "_wp_type_params_": (rows, columns, dtype),
            "_wp_type_args_": {"shape": (rows, columns), "dtype": dtype},
            "_wp_row_type_": vector(columns, dtype),
            "_native_": f"!warp.mat<{rows}x{columns} x {dtype._native_}>",
        }
        short = f"{rows}{columns}" if max(rows, columns) < 10 else f"{rows}x{columns}"
        shown = f"mat{short}{SUFFIX[dtype]}"
        _cache[key] = make_composite(name, shown, Matrix, rows * columns, dtype, attributes)
    return _cache[key]


def matrix_from_rows(*rows):
    """The matrix whose rows are the given vectors."""
    return _stack(rows)


def matrix_from_cols(*columns):
    """The matrix whose columns are the given vectors."""
    stacked = _stack(columns)
    shape = stacked._shape_
    numbers = [number for column in zip(*_rows(stacked), strict=True) for number in column]
    return matrix((shape[1], shape[0]), stacked._wp_scalar_type_)._from_numbers(numbers)


def _stack(vectors):
    if not vectors or not all(isinstance(v, Vector) for v in vectors):
        raise TypeError("expects vectors of one type")
    first = canonical_class(type(vectors[0]))
    for v in vectors:
        if canonical_class(type(v)) is not first:
            raise TypeError(
                f"expects vectors of one type, but got '{shown_name(first)}' and "
                f"'{shown_name(type(v))}'"
            )
    numbers = [number for v in vectors for number in scalars_of(v)]
    return matrix((len(vectors), first._length_), first._wp_scalar_type_)._from_numbers(numbers)


def composite_of_name(name):
    """The vector or matrix type of a name such as `vec5f` or `mat4x12d`, or None."""
    kind, rest = name[:3], name[3:]
    extents = rest.rstrip("abcdefghijklmnopqrstuvw")
    by_suffix = {suffix: dtype for dtype, suffix in SUFFIX.items()}
    dtype = by_suffix.get(rest[len(extents) :])
    if dtype is None or kind not in ("vec", "mat"):
        return None
    parts = extents.split("x") if "x" in extents or kind == "vec" else list(extents)
    if not all(part.isdecimal() for part in parts):
        return None
    numbers = tuple(map(int, parts))
    if kind == "vec" and len(numbers) == 1:
        return vector(numbers[0], dtype)
    return matrix(numbers, dtype) if kind == "mat" and len(numbers) == 2 else None
