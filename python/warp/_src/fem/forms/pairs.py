"""Plan by pairs - the form for each pair of nodes and components, at each point or at their node.

It makes no assumption about the integrand: operators of nodes of test and trial functions work.
"""

from __future__ import annotations

import functools

import warp as wp
from warp._src.fem.fields.by_node import NodeDescription
from warp._src.fem.forms.points import PointsPlan
from warp._src.fem.forms.terms import dof_count


class PairsPlan(PointsPlan):
    """Kernels that evaluate the form per pair of nodes.

    Attributes:
        is_nodal: test and trial functions are evaluated at their own node alone, which is the
            point of that number.
    """

    has_slots = False

    def __init__(self, record, is_nodal=False):
        self.is_nodal = is_nodal
        super().__init__(record)

    def _virtual(self, role):
        """The record of a test or trial function in the text of the form."""
        self.names[f"FIELD_{role.name}"] = NodeDescription(
            role.nodes, self.record.domain, role.role
        )
        return f"FIELD_{role.name}(0, fields.{role.role}_, domain_arg.geo)"

    def _slot_names(self, role):
        return []

    def _width(self, role) -> int:
        return role.nodes.node_count * role.halves

    @functools.cached_property
    def blocks(self):
        """Kernel over (element, test node) that writes blocks."""
        self.check_result()
        names = self.names
        names["Block"], names["check"] = self.block_dtype, wp.static
        rows = self._width(self.test)
        lines = [
            f"def pairs(first: int, {self.COMMON}, blocks: wp.array(dtype=Block)):",
            "    local, i = wp.tid()",
            "    domain_element = first + local",
            "    element = wp.max(element_index(domain_arg.index, domain_element), 0)",
        ]
        if self.trial is None:
            lines += [f"    block_index = local * {rows} + i"]
            self._sum(lines, "    ", "wp.vec2i(-1, -1)", 1)
        elif self.is_nodal:
            lines += [f"    block_index = local * {rows} + i"]
            self._sum(lines, "    ", "wp.vec2i(i, b)", dof_count(self.trial.nodes.dof_dtype))
        else:
            columns = self._width(self.trial)
            lines += [
                f"    for j in range({columns}):",
                f"        block_index = (local * {rows} + i) * {columns} + j",
            ]
            self._sum(lines, "        ", "wp.vec2i(j, b)", dof_count(self.trial.nodes.dof_dtype))
        return self._kernel("\n".join(lines) + "\n")

    def _sum(self, lines, indent, trial, columns):
        """Adds the sum over components and points of one block."""
        rows = dof_count(self.test.nodes.dof_dtype)
        points = "i, i + 1" if self.is_nodal else self.point_count
        is_scalar = rows * columns == 1 and self.block_dtype is self.record.scalar
        place = "" if is_scalar else "[a, b]" if self.trial is not None else "[a]"
        lines += [
            f"{indent}block = Block()",
            f"{indent}for a in range({rows}):",
            f"{indent}    for b in range({columns}):",
            f"{indent}        total = Real(0.0)",
            f"{indent}        for q in range({points}):",
            f"{indent}            s = {self.sample('q', 'wp.vec2i(i, a)', trial)}",
            f"{indent}            total += measure(domain_arg.geo, s) * s.qp_weight * "
            "form(s, domain_arg, fields, values, ())",
            f"{indent}        block{place} = total",
            f"{indent}blocks[block_index] = block",
        ]
