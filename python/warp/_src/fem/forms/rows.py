"""Plan by rows - element matrices on GPUs, a thread for some entries of a row.

A batch has too few elements for the threads of a GPU, and the sums of an element too many numbers
for the registers of a thread. So a thread has an element, a node of the test function and a few
nodes of the trial function. It evaluates the form at each point as the plan by points does, and
keeps its sums in registers.
"""

from __future__ import annotations

from warp._src.fem.forms.element_kernels import (
    add_coefficients,
    contracted,
    entries,
    joined,
    store_block,
)
from warp._src.fem.forms.terms import dof_count

# Pairs of nodes of an element from which rows are threads.
FEWEST_PAIRS = 65
# Numbers of the sums of a thread: a row of quadratic cubes, or three blocks of elasticity. Each
# thread evaluates the form at all points, so fewer sums repeat more of that.
_MOST_SUMS = 27


def rows_text(plan) -> tuple | None:
    """Text of the kernel, and its threads for an element; None if it does not apply."""
    test, trial = plan.test, plan.trial
    rows, columns = test.nodes.node_count, trial.nodes.node_count
    if rows * columns < FEWEST_PAIRS or test.halves != 1 or trial.halves != 1:
        return None
    if plan.structure.coefficients is None:
        return None
    if not all(role.basis(plan.record.rule).is_tabulated for role in (test, trial)):
        return None
    plan.names["Block"] = plan.block_dtype
    size = dof_count(test.nodes.dof_dtype) * dof_count(trial.nodes.dof_dtype)
    parts = -(-columns // max(1, _MOST_SUMS // size))
    width = -(-columns // parts)
    lines = [
        f"def rows(first: int, {plan.COMMON}, blocks: wp.array(dtype=Block)):",
        "    local, i, part = wp.tid()",
        "    domain_element = first + local",
        f"    start = part * {width}",
        f"    end = {'i + 1' if plan.is_symmetric else columns}",
        "    if start >= end:",
        "        return",
        *(f"    entry_{k} = Block()" for k in range(width)),
    ]
    plan._loop(lines)
    pairs = add_coefficients(plan, lines, "        ")
    sums = contracted(plan, pairs, test, lines, "        ")
    for k in range(width):
        # Nodes behind the last one stand for it, and are not stored.
        lines.append(f"        j = wp.min(start + {k}, {columns - 1})")
        lines.append(f"        entry_{k} += {entries(plan, sums, trial, lines, ' ' * 8)}")
    for k in range(width):
        lines += [f"    j = start + {k}", "    if j < end:", f"        block = entry_{k}"]
        store_block(plan, lines, "        ", f"local * {rows * columns}", columns)
    return joined(lines), (rows, parts)
