"""Facts of integrands - words, operators that are applied, types of results."""

from __future__ import annotations

import contextlib

import warp as wp
from warp import extend

# Names whose presence means that fields may be evaluated at samples other than the plan's.
_MOVERS = frozenset(
    (
        *("lookup", "partition_lookup", "Sample", "Sample_f64", "make_free_sample", "at_node"),
        *("to_inner_cell", "to_outer_cell", "to_cell_side", "cells", "element_coords"),
        *("test_dof", "trial_dof"),
    )
)


def words_of(function) -> frozenset:
    """Names and attributes in the text of an integrand and of the functions that it names."""
    found: set = set()
    seen: set = set()
    stack = [function.func]
    while stack:
        one = stack.pop()
        if one in seen:
            continue
        seen.add(one)
        words = _words_of_body(extend.syntax_of(one))
        found |= words
        closure = dict(zip(one.__code__.co_freevars, one.__closure__ or (), strict=True))
        for word in words:
            cell = closure.get(word)
            try:
                value = cell.cell_contents if cell else one.__globals__.get(word)
            except ValueError:
                continue
            if isinstance(value, wp.Function) and not _is_operator(value):
                stack += value.overloads
    return frozenset(found)


def _words_of_body(tree) -> set:
    """Names and attributes in the body of a function, not in its annotations."""
    import ast

    words = set()
    for statement in tree.body:
        for node in ast.walk(statement):
            words.add(getattr(node, "attr", None) or getattr(node, "id", ""))
    return words


def _is_operator(function) -> bool:
    return function.__module__ == "warp._src.fem.operators"


def returns_value(integrand) -> bool:
    """True if an integrand has a result."""
    import ast

    tree = extend.syntax_of(integrand.func)
    return any(isinstance(n, ast.Return) and n.value is not None for n in ast.walk(tree))


def may_move(words) -> bool:
    """True if fields may be evaluated at samples other than those of the plan."""
    return not _MOVERS.isdisjoint(words)


_recorded: list = []


def note_operation(role: str, name: str) -> None:
    """Tells a recording that an operator was applied to the field of a role."""
    for record in _recorded:
        record.setdefault(role, set()).add(name)


@contextlib.contextmanager
def recorded_operations():
    """A block whose translations tell which operators are applied: sets by role."""
    record: dict = {}
    _recorded.append(record)
    try:
        yield record
    finally:
        _recorded.remove(record)


def value_types(integrand, values: dict) -> dict:
    """Types of an integrand's values, by name.

    Raises:
        ValueError: a value is missing, or there is no such parameter.
    """
    for name in integrand.value_types:
        if name not in values:
            raise ValueError(
                f"integrand '{integrand.name}' expects a value '{name}', but got "
                f"{sorted(values) or 'none'}"
            )
    for name in values:
        if name not in integrand.value_types:
            raise ValueError(
                f"integrand '{integrand.name}' has no parameter '{name}' for a value, but "
                f"{sorted(integrand.value_types) or 'none'}"
            )
    return {name: _value_type(kind, values[name]) for name, kind in integrand.value_types.items()}


def _value_type(declared, value):
    """The type of one value: as declared, or that of the value where that is open."""
    if isinstance(value, wp.Function):
        return None
    try:
        canonical = extend.canonical(declared)
    except TypeError:
        canonical = None
    if canonical is not None:
        return canonical
    if extend.is_array(value):
        return wp.array(dtype=value.dtype, ndim=value.ndim)
    if extend.type_is_array(declared) and value is None:
        return declared
    return extend.canonical(type(value))
