"""Sum factorisation of element matrices - products of bases on squares and cubes, axis by axis.

The sum over points of an entry takes q^d products; axis by axis, all entries share the sums over
the points of the axes before. For each pair of nodes of the first axis, coefficients are summed
over its points, for each pair of the second over theirs, and so on: entries are sums along a line.
"""

from __future__ import annotations

import numpy as np

from warp._src.fem.forms.element_kernels import (
    MOST_KEPT,
    block_text,
    joined,
    kept_coefficients,
    store_block,
)
from warp._src.fem.forms.tensor import role_tables

# Nodes of a line from which it pays.
_FEWEST = {2: 5, 3: 3}


class _Axes:
    """The line tables of a plan's test and trial functions.

    Attributes:
        d: axes. q: points of a line. rows, columns: nodes of a line.
    """

    def __init__(self, plan, test, trial):
        self.plan = plan
        self.d = plan.test.nodes.element.cell.dimension
        (self.q, self.rows), (_, self.columns) = test[0].shape, trial[0].shape
        self.tables = test, trial
        self.real = np.float32 if plan.record.scalar.__name__ == "float32" else np.float64

    def table(self, row_slope, column_slope) -> str:
        """Name of the products of functions or slopes of a line, [pair of nodes, point]."""
        name = f"L_{int(row_slope)}{int(column_slope)}"
        left, right = self.tables[0][row_slope], self.tables[1][column_slope]
        made = np.einsum("qi,qj->ijq", left, right).reshape(-1, self.q)
        self.plan.names[name] = np.ascontiguousarray(made, dtype=self.real)
        return name


def _axes(plan) -> _Axes | None:
    test = plan.test
    if test.halves != 1 or plan.structure.coefficients is None:
        return None
    found = [role_tables(role, plan.record.rule) for role in (test, plan.trial)]
    if None in found:
        return None
    few = _FEWEST[test.nodes.element.cell.dimension]
    if min(tables[0].shape[1] for tables in found) < few:
        return None
    return _Axes(plan, *found)


def factored_text(plan) -> str | None:
    """Text of the kernel of element matrices; None if it does not apply."""
    axes = _axes(plan)
    if axes is None:
        return None
    found = {k: one for k, one in plan.structure.coefficients.items() if not one.is_zero}
    kept, count = len({one.number for one in found.values()}), axes.q**axes.d
    if not found or (kept * axes.q + len(found)) * axes.q ** (axes.d - 1) > MOST_KEPT:
        return None
    lines, pairs = kept_coefficients(plan, count)
    state: dict = {}
    for one in pairs:
        along = (
            int(one.ends[role.role][1][1:-1]) if one.is_gradient(role) else None
            for role in (plan.test, plan.trial)
        )
        state.setdefault((*one.block, *along), []).append(
            [f"kept_{one.text}[{q}]" for q in range(count)]
        )
    _nest(plan, axes, lines, state)
    return joined(lines)


def _nest(plan, axes, lines, state):
    """Adds the loops over pairs of nodes of each axis, with the sums over its points."""
    indent, same = "    ", ""
    for axis in range(axes.d):
        start = "0"
        if plan.is_symmetric:
            start = f"i_{axis}" if not same else f"wp.where({same}, i_{axis}, 0)"
            same += f"{' and ' * bool(same)}i_{axis} == j_{axis}"
        lines.append(f"{indent}for i_{axis} in range({axes.rows}):")
        lines.append(f"{indent}    for j_{axis} in range({start}, {axes.columns}):")
        indent += "        "
        lines.append(f"{indent}l_{axis} = i_{axis} * {axes.columns} + j_{axis}")
        state = _summed(axes, lines, indent, axis, state)
    for name, count in (("i", axes.rows), ("j", axes.columns)):
        number = f"{name}_0"
        for axis in range(1, axes.d):
            number = f"({number}) * {count} + {name}_{axis}"
        lines.append(f"{indent}{name} = {number}")
    block = block_text(plan, ((key[:2], sums[0][0]) for key, sums in state.items()))
    lines.append(f"{indent}block = {block}")
    rows, columns = axes.rows**axes.d, axes.columns**axes.d
    store_block(plan, lines, indent, f"local * {rows * columns}", columns)


def _summed(axes, lines, indent, axis, state) -> dict:
    """Adds sums over the points of an axis; gives their names by components and the axes along
    which functions are still to be differentiated."""
    rest = axes.q ** (axes.d - 1 - axis)
    groups: dict = {}
    for (row, column, a, b), sources in state.items():
        table = axes.table(a == axis, b == axis)
        left = (None if a == axis else a), (None if b == axis else b)
        groups.setdefault((row, column, *left), []).extend((table, one) for one in sources)
    made: dict = {}
    for table in sorted({table for terms in groups.values() for table, _ in terms}):
        for p in range(axes.q):
            lines.append(f"{indent}{table}_{axis}_{p} = {table}[l_{axis}, {p}]")
    for place, (key, terms) in enumerate(groups.items()):
        made[key] = [[f"sum_{axis}_{place}_{r}" for r in range(rest)]]
        for r, name in enumerate(made[key][0]):
            text = " + ".join(
                f"{table}_{axis}_{p} * {source[p * rest + r]}"
                for table, source in terms
                for p in range(axes.q)
            )
            lines.append(f"{indent}{name} = {text}")
    return made
