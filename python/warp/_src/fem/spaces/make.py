"""Makers of spaces - polynomial bases on a geometry, and spaces of values on a basis."""

from __future__ import annotations

from warp import extend
from warp._src.fem.cells.element import ElementBasis, make_element
from warp._src.fem.spaces.basis import BasisSpace, ShapeBasisSpace
from warp._src.fem.spaces.mappers import DofMapper
from warp._src.fem.spaces.space import (
    CollocatedFunctionSpace,
    ContravariantFunctionSpace,
    CovariantFunctionSpace,
)
from warp._src.fem.spaces.topology import make_element_based_space_topology


def make_polynomial_basis_space(
    geo, degree: int = 1, element_basis=None, discontinuous: bool = False, family=None
) -> BasisSpace:
    """Polynomial basis functions on a geometry.

    Args:
        geo: the geometry.
        degree: polynomial degree. Functions of degree 0 are constant in each cell.
        element_basis: an `ElementBasis`; Lagrange if not given.
        discontinuous: cells share no nodes.
        family: where the nodes of Lagrange and serendipity elements lie, a `Polynomial`.

    Raises:
        ValueError: the cells of the geometry have no such element.
    """
    element = make_element(geo.cell, degree, element_basis, family)
    is_broken = discontinuous or element_basis is ElementBasis.NONCONFORMING_POLYNOMIAL
    return ShapeBasisSpace(make_element_based_space_topology(geo, element, is_broken), element)


def _check_kind(basis_space, expected, word):
    kind = basis_space.element.map if basis_space.element else "identity"
    if kind != expected:
        raise ValueError(
            f"{word} spaces need basis functions of kind {expected!r}, but {basis_space.name!r} "
            f"is {kind!r}"
        )


def make_collocated_function_space(
    basis_space: BasisSpace, dtype=None, dof_mapper: DofMapper | None = None
) -> CollocatedFunctionSpace:
    """Functions whose nodes have all the components of a value.

    Args:
        basis_space: scalar basis functions.
        dtype: type of values; the scalar type of the geometry if not given.
        dof_mapper: from the components of a node to values, such as `SymmetricTensorMapper`.

    Raises:
        ValueError: basis functions are vectors, or types do not fit.
    """
    _check_kind(basis_space, "identity", "collocated")
    if dtype is not None and dof_mapper is None:
        real, scalar = extend.type_scalar_type(dtype), basis_space.geometry.scalar_type
        if extend.canonical(real) is not extend.canonical(scalar):
            raise ValueError(
                f"values of type {extend.type_repr(dtype)} do not fit a geometry of "
                f"{extend.type_repr(scalar)}"
            )
    return CollocatedFunctionSpace(basis_space, dtype=dtype, dof_mapper=dof_mapper)


def make_covariant_function_space(basis_space: BasisSpace) -> CovariantFunctionSpace:
    """Functions of a covariant basis, such as Nedelec's.

    Raises:
        ValueError: basis functions are of another kind.
    """
    _check_kind(basis_space, "covariant", "covariant")
    return CovariantFunctionSpace(basis_space)


def make_contravariant_function_space(basis_space: BasisSpace) -> ContravariantFunctionSpace:
    """Functions of a contravariant basis, such as that of Raviart and Thomas.

    Raises:
        ValueError: basis functions are of another kind.
    """
    _check_kind(basis_space, "contravariant", "contravariant")
    return ContravariantFunctionSpace(basis_space)


def make_polynomial_space(
    geo,
    dtype=None,
    dof_mapper: DofMapper | None = None,
    degree: int = 1,
    element_basis=None,
    discontinuous: bool = False,
    family=None,
):
    """Functions that are polynomials in each cell of a geometry.

    Args:
        geo: the geometry.
        dtype: type of values; the scalar type of the geometry if not given.
        dof_mapper: from the components of a node to values.
        degree, element_basis, discontinuous, family: see `make_polynomial_basis_space`.

    Returns:
        A collocated, covariant or contravariant space, as the element says.

    Raises:
        ValueError: the cells of the geometry have no such element, or types do not fit.
    """
    basis = make_polynomial_basis_space(geo, degree, element_basis, discontinuous, family)
    dimension, is_vector = geo.dimension, dtype is not None and extend.type_is_vector(dtype)
    if basis.element.map != "identity" and is_vector and dtype._length_ != dimension:
        raise ValueError(
            f"{element_basis.name} on '{geo.name}' has vectors of {dimension} components, but "
            f"'dtype' is {extend.type_repr(dtype)}"
        )
    if basis.element.map == "covariant":
        return make_covariant_function_space(basis)
    if basis.element.map == "contravariant":
        return make_contravariant_function_space(basis)
    return make_collocated_function_space(basis, dtype=dtype, dof_mapper=dof_mapper)
