"""Plan by reference tensors - coefficients that are constant in an element, integrals known before.

On affine cells, a form whose coefficients are the same at all points is a sum of coefficients times
integrals of products of basis functions over the reference cell, which are summed in float64 and
rounded once: no loop over points is left.
"""

from __future__ import annotations

import functools

import numpy as np

from warp._src.fem.forms.element_kernels import (
    add_coefficients,
    block_text,
    head,
    joined,
    store_block,
)

# Products of the sizes of elements up to which reference tensors are kept.
_MOST_ENTRIES = 1 << 17
# Kinds of geometries whose cells are equal.
_EQUAL_CELLS = ("Grid2D", "Grid3D", "nanogrid")


def applies(plan) -> bool:
    """True if the form of a plan has this kind of kernel."""
    record = plan.record
    if plan.test is None or plan.trial is None or record.rule is None:
        return False
    if not record.domain.is_cells or not record.domain.geometry.affine:
        return False
    bases = [role.basis(record.rule) for role in (plan.test, plan.trial)]
    size = plan.test.nodes.node_count * plan.trial.nodes.node_count
    if size > _MOST_ENTRIES or not all(one.is_tabulated for one in bases):
        return False
    return plan.structure.is_constant and not any(
        "fields" in one.on for one in plan.structure.coefficients.values()
    )


def repeats(plan) -> bool:
    """True if all elements have one matrix: on regular grids, where no coefficient tells them
    apart."""
    if plan.record.domain.geometry.kind not in _EQUAL_CELLS or not applies(plan):
        return False
    return not _signs(plan) and not any(
        "element" in one.on for one in plan.structure.coefficients.values()
    )


@functools.cache
def reference_tensor(test, trial, rule, parts) -> np.ndarray:
    """Integrals over the reference cell of products of basis functions.

    Args:
        test, trial: elements. rule: points and weights, whose sum is 1.
        parts: (gradient of the test function or not, component, the same of the trial function).

    Returns:
        (nodes of the test function, of the trial function) float64.
    """
    left = _component(test, rule, parts[0], parts[1])
    right = _component(trial, rule, parts[2], parts[3])
    return np.einsum("q,qi,qj->ij", rule.weights, left, right)


def _component(element, rule, is_gradient, subscript):
    numbers = element.tabulate(rule.points)[int(is_gradient)]
    place = tuple(int(one) for one in subscript.strip("[]").split(", ") if one)
    return numbers[(slice(None), slice(None), *place)]


def literal_text(plan) -> tuple:
    """Text of the kernel of element matrices, and the reference tensors, (tensors, entries)."""
    test, trial = plan.test, plan.trial
    rows, columns = test.nodes.node_count, trial.nodes.node_count
    lines = head(plan, "literal", ", tensors: wp.array2d(dtype=Real)")
    plan.first_sample(lines)
    lines += ["    scale = measure(domain_arg.geo, s)", f"    points = {plan.zero_points()}"]
    pairs = add_coefficients(plan, lines, "    ")
    tensors: list = []
    terms: list = []
    for one in pairs:
        ends = ((one.is_gradient(role), one.ends[role.role][1]) for role in (test, trial))
        parts = tuple(part for end in ends for part in end)
        found = reference_tensor(
            test.nodes.element, trial.nodes.element, plan.record.rule, parts
        ).reshape(-1)
        index = next((i for i, t in enumerate(tensors) if np.array_equal(t, found)), len(tensors))
        if index == len(tensors):
            tensors.append(found)
        terms.append((one.block, f"{one.text} * t_{index}"))
    size = rows * columns
    start = "i, " if plan.is_symmetric else ""
    indent = "            "
    lines.append(f"    for i in range({rows}):")
    lines.append(f"        for j in range({start}{columns}):")
    for i in range(len(tensors)):
        lines.append(f"{indent}t_{i} = tensors[{i}, i * {columns} + j]")
    block = block_text(plan, terms)
    turn = _signs(plan)
    if turn:
        block = f"{turn} * ({block})"
    lines.append(f"{indent}block = {block}")
    store_block(plan, lines, indent, f"local * {size}", columns)
    made = np.array(tensors) if tensors else np.zeros((1, size))
    return joined(lines), made


def _signs(plan) -> str:
    """The product of the signs of nodes i and j; empty if all are 1."""
    factors = []
    for role, place in ((plan.test, "i"), (plan.trial, "j")):
        sign = role.nodes.topology.functions.element_node_sign
        if sign is not None:
            plan.names[f"sign_{role.role}"] = sign
            factors.append(
                f"sign_{role.role}(domain_arg.geo, fields.{role.role}_.topology, element, {place})"
            )
    return " * ".join(factors)
