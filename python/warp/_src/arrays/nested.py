"""Numbers, scalars, composites and structs in nested lists, as NumPy arrays."""

from __future__ import annotations

import ctypes
import itertools

from warp._src import errors
from warp._src.types import dtypes, scalars
from warp._src.types.composites import Composite, scalars_of
from warp._src.types.numpy_types import element_layout
from warp._src.types.scalars import scalar_base

# The numbers of an array and of its elements.
_MOST_DIMENSIONS = 6
# Deeper lists contain themselves.
_DEEPEST = 32


def from_sequence(data, dtype):
    """A NumPy array of nested lists of numbers, scalars, composites or structs.

    Composites may stand beside lists, tuples and NumPy arrays of as many numbers.

    Raises:
        TypeError, ValueError, OverflowError: they are no elements of one type, or no array.
    """
    import numpy

    source = _rows_of_numbers(data)
    if source is not None:
        return _in_range(_exact(source, data, dtype), dtype)
    kinds = _kinds(data)
    composites = [kind for kind in kinds if issubclass(kind, (Composite, ctypes.Structure))]
    if composites and len(kinds) == 1:
        shape, leaves = _flatten(data)
        layout, inner = element_layout(dtypes.canonical(composites[0]))
        content = b"".join(map(contents, leaves))
        return numpy.frombuffer(content, layout).reshape(shape + inner)
    try:
        source = _beside_numbers(data, kinds, dtype) if composites else numpy.array(data)
        if source.dtype == object:
            # Numbers of Python and of this package beside each other.
            leaves = [one.value if isinstance(one, scalar_base) else one for one in source.flat]
            source = _exact(numpy.array(leaves), leaves, dtype).reshape(source.shape)
        elif not composites:
            source = _exact(source, data, dtype)
    except ValueError as error:
        if composites:
            raise _mixed(kinds) from None
        raise errors.WarpShapeError(f"cannot make an array of the data: {error}") from None
    if composites and dtype is None:
        source = source.astype(element_layout(composites[0]._wp_scalar_type_)[0])
    return _in_range(source, dtype)


def _rows_of_numbers(data):
    """A NumPy array of nested lists of plain numbers, or None if they may hold anything else.

    Where the first thing is a number NumPy takes nothing but numbers beside it, so the many types
    of these need no look.
    """
    import numpy

    leaf, depth = data, 0
    while depth <= _MOST_DIMENSIONS and type(leaf) in (list, tuple) and leaf:
        leaf, depth = leaf[0], depth + 1
    if type(leaf) not in (int, float):
        return None
    level = [data]
    for _ in range(depth - 1):
        level = list(itertools.chain.from_iterable(level))
        if not {list, tuple}.issuperset(map(type, level)):
            return None
    try:
        source = numpy.array(data)
    except ValueError:
        return None
    return None if source.dtype == object else source


def _exact(source, data, dtype):
    """The same, with integers that NumPy has made floats or objects of.

    It makes floats if some are beyond 2^63 and others are not, and beside floats; objects beyond
    2^64.

    Raises:
        OverflowError: an integer does not fit the element type.
    """
    import numpy

    scalar = getattr(dtype, "_wp_scalar_type_", dtype)
    if source.dtype == object:
        return _of_large_integers(source, scalar)
    if source.dtype != numpy.float64 or not _is_integer(scalar):
        return source
    if not (numpy.abs(source) >= 2.0**53).any():
        return source
    leaves = numpy.array(data, dtype=object)
    whole = [isinstance(one, (int, numpy.integer)) for one in leaves.flat]
    whole = numpy.array(whole).reshape(leaves.shape)
    if whole.any():
        _check_range(leaves[whole], scalar)
        with numpy.errstate(invalid="ignore"):
            source = source.astype(scalar._numpy_name_)
        source[whole] = leaves[whole]
    return source


def _of_large_integers(source, scalar):
    """Numbers of Python, of which some are beyond 64 bits, as floats; other objects as they are."""
    import numpy

    numbers = [one for one in source.flat if isinstance(one, (int, float, numpy.number))]
    if len(numbers) != source.size:
        return source
    integers = numpy.array([one for one in numbers if not isinstance(one, (float, numpy.floating))])
    if _is_integer(scalar):
        _check_range(integers, scalar)
    elif scalar is None:
        largest = max(integers, key=abs)
        raise errors.WarpOverflowError(f"{largest} fits no integer type; pass 'dtype=wp.float64'")
    try:
        return source.astype(numpy.float64)
    except OverflowError:
        largest = max(map(int, integers), key=abs)
        raise errors.WarpOverflowError(
            f"an integer of {largest.bit_length()} bits does not fit '{scalar.__name__}'"
        ) from None


def _in_range(source, dtype):
    """The same, if its integers fit the element type."""
    if dtype is not None and source.size and source.dtype.kind in "iu":
        _check_range(source, getattr(dtype, "_wp_scalar_type_", dtype))
    return source


def _kinds(data) -> set:
    """The types of what lists and tuples hold.

    Raises:
        ValueError: they are too deep, because one contains itself.
    """
    found, level = set(), [data]
    for depth in range(_DEEPEST):
        items = itertools.chain.from_iterable(level)
        kinds = set(map(type, itertools.chain.from_iterable(level)))
        lists = {kind for kind in kinds if issubclass(kind, (list, tuple))}
        found |= kinds - lists
        if not lists:
            return found
        level = [one for one in items if type(one) in lists] if kinds - lists else list(items)
        if depth > _MOST_DIMENSIONS:
            # Each list once: those that hold one list twice would become ever more.
            level = list({id(one): one for one in level}.values())
    raise errors.WarpShapeError(
        f"expects data nested less than {_DEEPEST} deep, but got a list that contains itself"
    )


def _mixed(kinds) -> errors.WarpTypeError:
    names = " and ".join(sorted(f"'{dtypes.type_repr(kind)}'" for kind in kinds))
    return errors.WarpTypeError(
        f"cannot make an array of the data: expects elements of one type, or sequences of as many "
        f"numbers, but got {names}"
    )


def _beside_numbers(data, kinds, dtype):
    """A NumPy array of composites beside sequences of numbers, a matrix's in rows or in a row.

    Only the element type tells that numbers in a row are a matrix.

    Raises:
        ValueError: the sequences have other lengths.
    """
    import numpy

    try:
        numbers = _numbers(data, kinds, rows=True)
        return _exact(numpy.array(numbers), numbers, dtype)
    except ValueError:
        if dtype is None:
            raise
        numbers = _numbers(data, kinds, rows=False)
        return _exact(numpy.array(numbers), numbers, dtype)


def _numbers(data, kinds, rows):
    """The same with lists of numbers in place of composites.

    Raises:
        TypeError: there are structs, which have none.
    """
    if any(issubclass(kind, ctypes.Structure) for kind in kinds):
        raise _mixed(kinds)

    def plain(value):
        if isinstance(value, Composite):
            import numpy

            scalar = value._wp_scalar_type_
            name = scalar._numpy_name_ if _is_integer(scalar) else None
            numbers = numpy.array(scalars_of(value), name)
            return numbers.reshape(value._shape_) if rows else numbers
        return [plain(one) for one in value] if isinstance(value, (list, tuple)) else value

    return plain(data)


def _is_integer(scalar) -> bool:
    if not (isinstance(scalar, type) and issubclass(scalar, scalars.int_base)):
        return False
    return scalar is not scalars.bool


def _check_range(source, scalar):
    import numpy

    if not _is_integer(scalar):
        return
    limits = numpy.iinfo(scalar._numpy_name_)
    for value in (int(source.min()), int(source.max())):
        if not limits.min <= value <= limits.max:
            raise errors.WarpOverflowError(f"{value} does not fit '{scalar.__name__}'")


def _flatten(data):
    """Shape of nested lists and their leaves."""
    if not isinstance(data, (list, tuple)):
        return (), [data]
    shapes, leaves = set(), []
    for item in data:
        shape, inner = _flatten(item)
        shapes.add(shape)
        leaves += inner
    if len(shapes) > 1:
        raise errors.WarpShapeError("expects rows of one length in nested lists")
    return (len(data), *(shapes.pop() if shapes else ())), leaves


def contents(value) -> bytes:
    """Memory of a composite or struct. It may be read where nobody looks for gradients again."""
    if hasattr(value, "refresh"):
        value.refresh()
    return bytes(value)
