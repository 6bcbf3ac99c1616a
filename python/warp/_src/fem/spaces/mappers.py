"""Tensor mappers - symmetric and skew tensors as vectors of their independent components.

A tensor T has the components T : B_k / 2 for an orthonormal basis of tensors B_k, whose inner
product is half of that of Frobenius.
"""

import functools
import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

import warp as wp
from warp import extend


class Mapping(Enum):
    """Bases of symmetric tensors."""

    VOIGT = 0
    """Entries of the diagonal, then the ones beside it."""

    DB16 = 1
    """The trace, then the deviatoric diagonal, then the entries beside it (Daviet and
    Bertails-Descoubes 2016)."""


@wp.func
def _same(value: Any):
    return value


@dataclass(frozen=True)
class MapperRecord:
    """Facts of a mapper that its functions of kernels depend on.

    `kind` is identity, symmetric or skew; `dtype` is the type of values.
    """

    kind: str
    dtype: type
    mapping: Mapping = Mapping.VOIGT

    @property
    def functions(self):
        """(dof to value, value to dof), or None if they are the same."""
        return None if self.kind == "identity" else mapper_functions(self)


def _beside(size):
    """Tensors with entries beside the diagonal: yz, xz, xy."""
    pairs = [(0, 1)] if size == 2 else [(1, 2), (0, 2), (0, 1)]
    made = np.zeros((len(pairs), size, size))
    for k, (i, j) in enumerate(pairs):
        made[k, i, j] = made[k, j, i] = 1.0
    return made


@functools.cache
def tensor_basis(record: MapperRecord) -> np.ndarray:
    """The tensors of the components, (components, n, n)."""
    size = record.dtype._shape_[0]
    if record.kind == "skew":
        if size == 2:
            return np.array([[[0.0, -1.0], [1.0, 0.0]]])
        return np.array([-np.cross(np.eye(3), axis) for axis in np.eye(3)]).transpose(0, 2, 1)
    if record.mapping is Mapping.VOIGT:
        diagonal = math.sqrt(2.0) * np.array([np.diag(e) for e in np.eye(size)])
    elif size == 2:
        diagonal = np.array([np.eye(2), np.diag([1.0, -1.0])])
    else:
        rows = [[math.sqrt(2.0 / 3.0)] * 3, [1.0, -1.0, 0.0], [-(3**-0.5), -(3**-0.5), 2 * 3**-0.5]]
        diagonal = np.array([np.diag(row) for row in rows])
    return np.concatenate((diagonal, _beside(size)))


def dof_type(record: MapperRecord) -> type:
    """Type of the components of a node."""
    if record.kind == "identity":
        return record.dtype
    real, count = extend.type_scalar_type(record.dtype), len(tensor_basis(record))
    return real if count == 1 else wp.types.vector(length=count, dtype=real)


def _sum(terms, is_double):
    """Text of a sum of products; zero factors are left out. Factors of float32 are plain literals,
    which Python evaluates in float64, too."""
    form = "real({})" if is_double else "{}"
    products = [f"{form.format(repr(float(c)))} * {name}" for c, name in terms if c != 0.0]
    return " + ".join(products) or "real(0.0)"


@functools.cache
def mapper_functions(record: MapperRecord) -> tuple:
    """Functions of kernels from components to a tensor, and back."""
    basis, made = tensor_basis(record), dof_type(record)
    size, count = basis.shape[1], len(basis)
    names = {
        "Dof": made,
        "Value": record.dtype,
        "real": extend.type_scalar_type(record.dtype),
    }
    is_double = names["real"] is wp.float64
    parts = ["dof"] if count == 1 else [f"dof[{k}]" for k in range(count)]
    places = [(i, j) for i in range(size) for j in range(size)]
    entries = [
        _sum([(b[i, j], p) for b, p in zip(basis, parts, strict=True)], is_double)
        for i, j in places
    ]
    inner = [
        _sum([(0.5 * b[i, j], f"value[{i}, {j}]") for i, j in places], is_double) for b in basis
    ]
    back = inner[0] if count == 1 else f"Dof({', '.join(inner)})"
    texts = (
        f"def dof_to_value(dof: Dof):\n    return Value({', '.join(entries)})\n",
        f"def value_to_dof(value: Value):\n    return {back}\n",
    )
    return tuple(wp.func(extend.function_from_text(text, names, module=__name__)) for text in texts)


class DofMapper:
    """Base of mappers from the components of a node to values.

    Attributes:
        value_dtype: type of values.
        dof_dtype: type of the components of a node.
        DOF_SIZE: number of components.
        record: facts that functions of kernels depend on.
    """

    record: MapperRecord

    def __init__(self, record: MapperRecord):
        self.record = record
        self.value_dtype, self.dof_dtype = record.dtype, dof_type(record)
        if record.kind == "skew" and self.dof_dtype is wp.float32:
            self.dof_dtype = float
        self.DOF_SIZE = extend.type_size(self.dof_dtype)

    @property
    def dof_to_value(self):
        """Function of kernels from components to a value."""
        return (self.record.functions or (_same, _same))[0]

    @property
    def value_to_dof(self):
        """Function of kernels from a value to components."""
        return (self.record.functions or (_same, _same))[1]

    def __eq__(self, other) -> bool:
        return isinstance(other, DofMapper) and self.record == other.record

    def __hash__(self) -> int:
        return hash(self.record)

    def __str__(self) -> str:
        return f"{self.record.kind}_{extend.type_repr(self.value_dtype)}"


class IdentityMapper(DofMapper):
    """Components that are the value itself."""

    def __init__(self, dtype: type):
        super().__init__(MapperRecord("identity", extend.canonical(dtype)))


def _tensor_type(dtype):
    """A 2x2 or 3x3 matrix type.

    Raises:
        ValueError: it is none.
    """
    dtype = extend.canonical(dtype)
    if not extend.type_is_matrix(dtype) or dtype._shape_ not in ((2, 2), (3, 3)):
        raise ValueError(
            f"mappers of tensors expect a 2x2 or 3x3 matrix type, but got {extend.type_repr(dtype)}"
        )
    return dtype


_WAYS = ("dof_to_value", "value_to_dof")


class _SymmetricFunctions(type):
    """Functions of kernels as attributes, for float32 and float64: `value_to_dof_3d`,
    `dof_to_value_2d_voigt` and so on."""

    def __getattr__(cls, name):
        words = name.split("_")
        way, mapping = "_".join(words[:3]), Mapping.VOIGT if "voigt" in words else Mapping.DB16
        sizes = [size for size in (2, 3) if f"{size}d" in words[3:4]]
        if way not in _WAYS or not sizes:
            raise AttributeError(f"type object {cls.__name__!r} has no attribute {name!r}")
        found = None
        for real in (wp.float32, wp.float64):
            dtype = wp.types.matrix(shape=(sizes[0], sizes[0]), dtype=real)
            one = mapper_functions(MapperRecord("symmetric", dtype, mapping))[_WAYS.index(way)]
            if found is None:
                found = wp.Function(one.func, key=name)
            else:
                found.add_overload(one.func)
        setattr(cls, name, found)
        return found


class SymmetricTensorMapper(DofMapper, metaclass=_SymmetricFunctions):
    """Components of symmetric tensors: 3 of 2x2, 6 of 3x3 ones.

    Args:
        dtype: matrix type of values.
        mapping: basis of the tensors.

    Raises:
        ValueError: `dtype` is no 2x2 or 3x3 matrix.
    """

    Mapping = Mapping

    def __init__(self, dtype: type, mapping: Mapping = Mapping.VOIGT):
        super().__init__(MapperRecord("symmetric", _tensor_type(dtype), mapping))
        self.mapping = mapping


class SkewSymmetricTensorMapper(DofMapper):
    """Components of skew tensors: 1 of 2x2, 3 of 3x3 ones.

    Args:
        dtype: matrix type of values.

    Raises:
        ValueError: `dtype` is no 2x2 or 3x3 matrix.
    """

    def __init__(self, dtype: type):
        super().__init__(MapperRecord("skew", _tensor_type(dtype)))
