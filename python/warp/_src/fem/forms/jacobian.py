"""Plan of Jacobians - values of an integrand per point or node, for each trial function."""

from __future__ import annotations

import functools

import warp as wp
from warp._src.fem.forms.pairs import PairsPlan
from warp._src.fem.forms.terms import components, dof_count
from warp._src.fem.forms.values import dof_value_function
from warp._src.fem.spaces.node_dofs import dof_functions
from warp._src.fem.types import OUTSIDE


class JacobianPlan(PairsPlan):
    """Kernels that write derivatives by the trial function.

    Attributes:
        space: record of the space whose nodes are the places; None for quadrature points.
    """

    def __init__(self, record, space):
        self.space = space
        super().__init__(record)

    @property
    def row_type(self):
        """Type of a row's values."""
        return self.result if self.space is None else self.space.dof_dtype

    @property
    def block_dtype(self):
        """Type of a block: rows are components of values, columns those of the trial function."""
        real, trial = self.record.scalar, self.trial.nodes.dof_dtype
        shape = dof_count(self.row_type), dof_count(trial)
        is_scalar = components(self.row_type) == [""] and components(trial) == [""]
        return real if is_scalar else wp.types.matrix(shape, real)

    def _sample(self, trial) -> str:
        """The sample of row i."""
        if self.space is None:
            return self.sample("i", trial=trial)
        return (
            "Sample(element, node_coords(domain_arg.geo, topology, element, i), "
            "node_index(domain_arg.geo, topology, element, i), Real(1.0), wp.vec2i(-1, -1), "
            f"{trial})"
        )

    def _space_names(self):
        self.names["TopologyArg"] = wp.int32
        if self.space is not None:
            topology = self.space.topology.functions
            self.names |= {
                "TopologyArg": topology.TopologyArg,
                "node_coords": self.space.functions.node_coords,
                "node_index": topology.element_node_index,
                "to_dof": dof_value_function(self.space),
            }
            if self.space.kind != "identity":
                self.names |= vars(dof_functions(self.space))

    @functools.cached_property
    def blocks(self):
        """Kernel over (element, row of the element)."""
        self._space_names()
        self.names |= {"Block": self.block_dtype, "Value": self.row_type}
        columns = self._width(self.trial)
        row = components(self.row_type)
        trial_dofs = dof_count(self.trial.nodes.dof_dtype)
        lines = [
            "def jacobian(first: int, topology: TopologyArg, factors: wp.array2d(dtype=Real), "
            f"{self.COMMON}, blocks: wp.array(dtype=Block)):",
            "    local, i = wp.tid()",
            "    domain_element = first + local",
            "    element = element_index(domain_arg.index, domain_element)",
            "    factor = factors[domain_element, i]",
            f"    base = (local * factors.shape[1] + i) * {columns}",
            f"    for j in range({columns}):",
            "        block = Block()",
            "        if factor != Real(0.0):",
            f"            for b in range({trial_dofs}):",
            f"                s = {self._sample('wp.vec2i(j, b)')}",
        ]
        value, of_node = "value", "domain_arg.geo, topology, element, i"
        if self.space is not None and self.space.kind != "identity":
            lines += [
                "                value = Real(0.0)",
                f"                for q in range(dof_point_count({of_node})):",
                "                    r = s",
                f"                    r.element_coords = dof_point_coords({of_node}, q)",
                "                    there = form(r, domain_arg, fields, values, ())",
                f"                    value += dof_part({of_node}, q, there)",
            ]
        elif self.space is not None:
            value = "dof"
            lines += [
                "                value = form(s, domain_arg, fields, values, ())",
                "                dof = to_dof(value)",
            ]
        else:
            lines.append("                value = form(s, domain_arg, fields, values, ())")
        for place, subscript in enumerate(row):
            target = "block" if self.block_dtype is self.record.scalar else f"block[{place}, b]"
            lines.append(f"                {target} = factor * Real({value}{subscript})")
        lines.append("        blocks[base + j] = block")
        return self._kernel("\n".join(lines) + "\n")

    @functools.cache  # noqa: B019 - plans live as long as the program
    def factors(self, reduction):
        """Kernel over nodes that writes the weight of the value of each element."""
        self._space_names()
        weight = "measure(domain_arg.geo, s)" if reduction == "weighted_average" else "Real(1.0)"
        lines = [
            "def factors_of_nodes(begins: wp.array(dtype=int), positions: wp.array(dtype=int), "
            f"width: int, topology: TopologyArg, {self.COMMON}, factors: wp.array2d(dtype=Real)):",
            "    node = wp.tid()",
            "    total = Real(0.0)",
            "    for at in range(begins[node], begins[node + 1]):",
            "        domain_element = positions[at] // width",
            "        i = positions[at] - domain_element * width",
            "        element = element_index(domain_arg.index, domain_element)",
            f"        s = {self._sample('wp.vec2i(-1, -1)')}",
            f"        if s.element_coords[0] != Real({OUTSIDE}):",
            f"            weight = {weight}",
        ]
        if reduction == "first" and self.trial.nodes.element is None:
            # An element without points has no value.
            self.names["trial_count"] = self.trial.nodes.topology.functions.element_node_count
            count = "trial_count(domain_arg.geo, fields.trial_.topology, element)"
            lines.append(f"            weight = wp.where({count} > 0, weight, Real(0.0))")
        if reduction == "first":
            lines.append("            weight = wp.where(total == Real(0.0), weight, Real(0.0))")
        lines += ["            factors[domain_element, i] = weight", "            total += weight"]
        if reduction in ("weighted_average", "mean"):
            lines += [
                "    for at in range(begins[node], begins[node + 1]):",
                "        domain_element = positions[at] // width",
                "        i = positions[at] - domain_element * width",
                "        if total > Real(0.0):",
                "            factors[domain_element, i] = factors[domain_element, i] / total",
            ]
        return self._kernel("\n".join(lines) + "\n")
