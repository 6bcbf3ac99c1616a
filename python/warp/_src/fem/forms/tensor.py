"""Sum factorisation - tensor products of bases on squares and cubes, axis by axis.

The sum over the nodes of a cell at all points takes n^d q^d products; axis by axis it takes about
d n q^d. Values and gradients of discrete fields are made so before the loop over points, and
coefficients of the test function are summed so after it.
"""

from __future__ import annotations

import functools

import numpy as np

from warp import extend
from warp._src.fem.forms.terms import MOST_LOCAL

# Nodes of a cell from which it pays.
_FEWEST_NODES = {2: 9, 3: 27}


@functools.cache
def line_tables(element, rule):
    """Basis functions and slopes of a line at the points of a line, (q, n), if the element and the
    rule are products of lines; None otherwise."""
    if element is None or rule is None or element.cell.name not in ("square", "cube"):
        return None
    if element.map != "identity" or element.orientation_count > 1:
        return None
    dimension = element.cell.dimension
    count, nodes = (round(n ** (1 / dimension)) for n in (rule.point_count, element.node_count))
    if count**dimension != rule.point_count or nodes**dimension != element.node_count:
        return None
    values, gradients = element.tabulate(rule.points)
    shape = (count,) * dimension + (nodes,) * dimension
    first = (slice(None), *(0,) * (dimension - 1))
    others = tuple(range(2, dimension + 1))
    table = values.reshape(shape)[first].sum(axis=others)
    slopes = gradients[..., 0].reshape(shape)[first].sum(axis=others)
    product, slope = table, slopes
    for _ in range(dimension - 1):
        product, slope = np.kron(product, table), np.kron(slope, table)
    close = np.allclose(product, values, atol=1e-12) and np.allclose(
        slope, gradients[..., 0], atol=1e-11
    )
    last = np.kron(np.ones((1, 1)), table)
    for axis in range(1, dimension):
        last = np.kron(last, slopes if axis == dimension - 1 else table)
    return (table, slopes) if close and np.allclose(last, gradients[..., -1], atol=1e-11) else None


class Lines:
    """The texts of the contractions of one role.

    Attributes:
        d: axes. n, q: nodes and points of a line. value, gradient: numbers of the slots that are
            used, or None.
    """

    def __init__(self, plan, role, table, slopes):
        self.plan, self.role, self.table, self.slopes = plan, role, table, slopes
        self.d = role.nodes.element.cell.dimension
        self.q, self.n = self.table.shape
        used = dict(role.used_slots)
        self.value = 0 if 0 in used else None
        self.gradient = 1 if 1 in used else None
        self.name = role.role
        self.tables = f"B_{self.name}", f"G_{self.name}"
        real = np.float32 if plan.record.scalar.__name__ == "float32" else np.float64
        plan.names[self.tables[0]] = self.table.astype(real)
        plan.names[self.tables[1]] = self.slopes.astype(real)
        plan.names[f"Dof_{self.name}"] = role.nodes.dof_dtype

    @property
    def memory(self) -> int:
        """Numbers of the largest array of the thread."""
        return max(self.q, self.n) ** self.d * extend.type_size(self.role.nodes.dof_dtype)

    def before_points(self, lines, source):
        """Adds the contractions of all axes but the first."""
        state = {None: source}
        for axis in range(self.d - 1, 0, -1):
            state = self._forward(lines, state, axis)
        self.state = state

    def _forward(self, lines, state, axis):
        rest, outer = self.q ** (self.d - 1 - axis), self.n**axis
        sources = {None: (state[None], self.tables[0])}
        if self.gradient is not None:
            sources[axis] = (state[None], self.tables[1])
            sources |= {t: (s, self.tables[0]) for t, s in state.items() if t is not None}
        made = {}
        for tag in sources:
            made[tag] = f"line_{self.name}_{axis}_{'v' if tag is None else tag}"
            size = outer * self.q * rest
            lines.append(f"    {made[tag]} = wp.zeros(shape=({size},), dtype=Dof_{self.name})")
        lines += [
            f"    for m in range({outer}):",
            f"        for p in range({self.q}):",
            f"            for r in range({rest}):",
        ]
        for tag in sources:
            lines.append(f"                sum_{'v' if tag is None else tag} = Dof_{self.name}()")
        lines.append(f"                for along in range({self.n}):")
        for tag, (source, table) in sources.items():
            lines.append(
                f"                    sum_{'v' if tag is None else tag} += {table}[p, along] * "
                f"{source}[(m * {self.n} + along) * {rest} + r]"
            )
        for tag in sources:
            lines.append(
                f"                {made[tag]}[(m * {self.q} + p) * {rest} + r] = "
                f"sum_{'v' if tag is None else tag}"
            )
        return made

    def at_point(self, lines):
        """Adds the slots at point q from the first axis."""
        rest, indent = self.q ** (self.d - 1), "        "
        wanted = {}
        if self.value is not None:
            wanted["v"] = (self.state[None], self.tables[0])
        if self.gradient is not None:
            wanted["0"] = (self.state[None], self.tables[1])
            wanted |= {str(t): (s, self.tables[0]) for t, s in self.state.items() if t is not None}
        for tag in wanted:
            lines.append(f"{indent}at_{self.name}_{tag} = Dof_{self.name}()")
        lines.append(f"{indent}for along in range({self.n}):")
        for tag, (source, table) in wanted.items():
            lines.append(
                f"{indent}    at_{self.name}_{tag} += {table}[q // {rest}, along] * "
                f"{source}[along * {rest} + q % {rest}]"
            )
        if self.value is not None:
            lines.append(f"{indent}{self.name}_0 = at_{self.name}_v")
        if self.gradient is not None:
            parts = [f"at_{self.name}_{k}" for k in range(self.d)]
            is_number = not extend.type_is_vector(self.role.nodes.dof_dtype)
            make = f"Slot_{self.name}_1" if is_number else "wp.matrix_from_cols"
            lines.append(f"{indent}{self.name}_1 = {make}({', '.join(parts)})")

    def store(self, lines):
        """Adds the stores of the coefficients of the test function at point q."""
        if self.value is not None:
            lines.append("        kept_v[q] = c_0")
        if self.gradient is not None:
            is_vector = extend.type_is_vector(self.role.nodes.dof_dtype)
            for k in range(self.d):
                part = f"wp.transpose(c_1)[{k}]" if is_vector else f"c_1[{k}]"
                lines.append(f"        kept_{k}[q] = {part}")

    def memory_lines(self) -> list:
        """Arrays of the coefficients at all points."""
        tags = ["v"] if self.value is not None else []
        tags += [str(k) for k in range(self.d)] if self.gradient is not None else []
        size = self.q**self.d
        return [f"    kept_{t} = wp.zeros(shape=({size},), dtype=Dof_{self.name})" for t in tags]

    def after_points(self, lines):
        """Adds the sums over points, axis by axis, and the stores of the blocks."""
        state = {"v": "kept_v"} if self.value is not None else {}
        if self.gradient is not None:
            state |= {str(k): f"kept_{k}" for k in range(self.d)}
        for axis in range(self.d):
            state = self._backward(lines, state, axis)

    def _backward(self, lines, state, axis):
        rest, outer, n = self.q ** (self.d - 1 - axis), self.n**axis, self.n
        terms: dict = {}
        if "v" in state:
            terms.setdefault("v", []).append((state["v"], self.tables[0]))
        if str(axis) in state:
            terms.setdefault("v", []).append((state[str(axis)], self.tables[1]))
        for tag, source in state.items():
            if tag not in ("v", str(axis)):
                terms.setdefault(tag, []).append((source, self.tables[0]))
        is_last, made = axis == self.d - 1, {}
        for tag in terms:
            made[tag] = f"back_{axis}_{tag}"
            if not is_last:
                size = outer * n * rest
                lines.append(f"    {made[tag]} = wp.zeros(shape=({size},), dtype=Dof_{self.name})")
        lines += [
            f"    for m in range({outer}):",
            f"        for i in range({n}):",
            f"            for r in range({rest}):",
        ]
        lines += [f"                sum_{tag} = Dof_{self.name}()" for tag in terms]
        lines.append(f"                for p in range({self.q}):")
        for tag, parts in terms.items():
            text = " + ".join(
                f"{table}[p, i] * {source}[(m * {self.q} + p) * {rest} + r]"
                for source, table in parts
            )
            lines.append(f"                    sum_{tag} += {text}")
        for tag in terms:
            target = f"{made[tag]}[(m * {n} + i) * {rest} + r]"
            if is_last:
                target = f"blocks[local * {n**self.d} + m * {n} + i]"
            lines.append(f"                {target} = sum_{tag}")
        return made


def role_tables(role, rule):
    """Tables of a line of a role's basis, see `line_tables`; None if it is no product of numbers
    that are the same in all cells."""
    tables = line_tables(role.nodes.element, rule) if role.halves == 1 else None
    if tables is None or role.nodes.topology.functions.element_node_sign is not None:
        return None
    if extend.type_is_matrix(role.nodes.dof_dtype) or role.nodes.space.mapper is not None:
        return None
    return tables


def lines_of(plan, role) -> Lines | None:
    """The contractions of a role; None if its basis is no product, or a small one."""
    tables, element = role_tables(role, plan.record.rule), role.nodes.element
    if tables is None or element.node_count < _FEWEST_NODES[element.cell.dimension]:
        return None
    lines = Lines(plan, role, *tables)
    return lines if role.used_slots and lines.memory <= MOST_LOCAL else None
