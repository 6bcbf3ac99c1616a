"""Plan by rows - element matrices on GPUs, a thread for some entries of a row.

A batch has too few elements for the threads of a GPU, and the sums of an element too many numbers
for the registers of a thread. So a thread has an element, a node of the test function and a few
nodes of the trial function. It evaluates the form at each point as the plan by points does, and
keeps its sums in registers.
"""

from __future__ import annotations

from warp._src.fem.forms.element_kernels import add_coefficients, block_text, store_block
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
    groups = _row_sums(plan, lines)
    for k in range(width):
        # Nodes behind the last one stand for it, and are not stored.
        lines.append(f"        j = wp.min(start + {k}, {columns - 1})")
        lines.append(f"        entry_{k} += {_entry(plan, lines, groups)}")
    for k in range(width):
        lines += [f"    j = start + {k}", "    if j < end:", f"        block = entry_{k}"]
        store_block(plan, lines, "        ", f"local * {rows * columns}", columns)
    return "\n".join(lines) + "\n", (rows, parts)


def _row_sums(plan, lines) -> dict:
    """Adds the products of coefficients with the basis functions of node i; gives their names by
    the slot of the trial function, the component of its basis, and those of the block."""
    groups: dict = {}
    for one in add_coefficients(plan, lines, "        "):
        key = one.column_number, one.column_basis, one.row_dof, one.column_dof
        groups.setdefault(key, []).append(one)
    for number in sorted({one.row_number for ones in groups.values() for one in ones}):
        call = plan._basis_call(plan.test, plan.test.slots[number], "q", "i")
        lines.append(f"        a_{number} = {call}")
    for place, (key, ones) in enumerate(groups.items()):
        terms = [f"{one.text} * a_{one.row_number}{one.row_basis}" for one in ones]
        lines.append(f"        r_{place} = {' + '.join(terms)}")
        groups[key] = f"r_{place}"
    return groups


def _entry(plan, lines, groups) -> str:
    """Adds the basis functions of node j; gives the text of the block."""
    for number in sorted({key[0] for key in groups}):
        call = plan._basis_call(plan.trial, plan.trial.slots[number], "q", "j")
        lines.append(f"        b_{number} = {call}")
    entries: dict = {}
    for (number, basis, row, column), text in groups.items():
        entries.setdefault((row, column), []).append(f"{text} * b_{number}{basis}")
    if not entries:
        return "Block()"
    return block_text(plan, {key: " + ".join(terms) for key, terms in entries.items()})
