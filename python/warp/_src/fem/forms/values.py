"""Plan of values - the integrand at nodes, points, elements or free samples, without slots."""

import functools
from typing import Any

import warp as wp
from warp._src.fem.forms.points import PointsPlan
from warp._src.fem.spaces.node_dofs import dof_functions
from warp._src.fem.types import OUTSIDE, Ints, coords_type, sample_type


class ValuesPlan(PointsPlan):
    """Kernels that evaluate an integrand; fields are read from memory."""

    has_slots = False

    @functools.cache  # noqa: B019 - plans live as long as the program
    def at_points(self, dtype, has_result):
        """Kernel over elements that writes the value at each point of the quadrature."""
        self.names |= {"Out": dtype or wp.float32}
        lines = [
            f"def values_at_points({self.COMMON}, result: wp.array(dtype=Out)):",
            "    domain_element = wp.tid()",
            "    element = element_index(domain_arg.index, domain_element)",
            "    if element >= 0:",
            f"        for q in range({self.point_count}):",
            f"            s = {self.sample('q')}",
        ]
        lines.append(self._store("            ", "s.qp_index", has_result))
        return self._kernel("\n".join(lines) + "\n")

    @functools.cache  # noqa: B019
    def at_samples(self, dtype, has_result):
        """Kernel over samples without a place."""
        self.names |= {"Out": dtype or wp.float32, "Coords": coords_type(self.record.scalar)}
        lines = [
            f"def values_at_samples(dim: int, {self.COMMON}, result: wp.array(dtype=Out)):",
            "    index = wp.tid()",
            f"    s = Sample(-1, Coords(Real({OUTSIDE})), index, Real(1.0) / Real(dim), "
            "wp.vec2i(-1, -1), wp.vec2i(-1, -1))",
        ]
        lines.append(self._store("    ", "index", has_result))
        return self._kernel("\n".join(lines) + "\n")

    def _store(self, indent, index, has_result):
        call = "form(s, domain_arg, fields, values, ())"
        if not has_result or self.result is None:
            return f"{indent}{call}"
        return f"{indent}result[{index}] = Out({call})"

    @functools.cache  # noqa: B019
    def at_nodes(self, space, reduction, dtype):
        """Kernel over nodes: values of the elements of a node in their order, reduced."""
        Value, Dof = space.dtype, dtype or space.dof_dtype
        evaluate, to_dof = self.names["form"], dof_value_function(space)
        functions = space.functions
        has_moments = space.kind != "identity"
        if has_moments:
            Value, of_nodes = space.dof_dtype, dof_functions(space)
            point_count, point_coords = of_nodes.dof_point_count, of_nodes.dof_point_coords
            part = of_nodes.dof_part
        node_coords, TopologyArg = functions.node_coords, space.topology.functions.TopologyArg
        node_index, count = space.topology.functions.element_node_index, space.topology.nodes
        Common = [self.names[n] for n in ("DomainArg", "QuadratureArg", "Fields", "Values")]
        DomainArg, QuadratureArg, Fields, Values = Common
        Tables, Arg, measure = self.Tables, sample_type(self.record.scalar), self.names["measure"]
        element_index, Real = self.names["element_index"], self.record.scalar
        discards = dtype is None or self.result is None
        convert = functools.partial(_conversion, self, space)
        converted = None if discards else convert()

        def values_at_nodes(
            begins: Ints,
            positions: Ints,
            topology: TopologyArg,
            domain_arg: DomainArg,
            quadrature: QuadratureArg,
            fields: Fields,
            values: Values,
            tables: Tables,
            result: wp.array(dtype=Dof),
        ):
            node = wp.tid()
            total = Value()
            weight = Real(0.0)
            for at in range(begins[node], begins[node + 1]):
                position = positions[at]
                element = element_index(domain_arg.index, position // count)
                k = position - (position // count) * count
                coords = node_coords(domain_arg.geo, topology, element, k)
                is_new = wp.static(reduction != "first") or weight == Real(0.0)
                if coords[0] != Real(OUTSIDE) and is_new:
                    s = Arg(
                        element,
                        coords,
                        node_index(domain_arg.geo, topology, element, k),
                        Real(1.0),
                        wp.vec2i(-1, -1),
                        wp.vec2i(-1, -1),
                    )
                    if wp.static(discards):
                        evaluate(s, domain_arg, fields, values, ())
                        weight = Real(1.0)
                    else:
                        if wp.static(has_moments):
                            value = Value(0.0)
                            for q in range(point_count(domain_arg.geo, topology, element, k)):
                                r = s
                                r.element_coords = point_coords(
                                    domain_arg.geo, topology, element, k, q
                                )
                                there = converted(evaluate(r, domain_arg, fields, values, ()))
                                value += part(domain_arg.geo, topology, element, k, q, there)
                        else:
                            value = converted(evaluate(s, domain_arg, fields, values, ()))
                        if wp.static(reduction == "weighted_average"):
                            volume = measure(domain_arg.geo, s)
                            weight += volume
                            total += volume * value
                        elif wp.static(reduction == "mean"):
                            weight += Real(1.0)
                            total += value
                        elif wp.static(reduction == "max"):
                            total = wp.where(weight > Real(0.0), wp.max(total, value), value)
                            weight = Real(1.0)
                        elif wp.static(reduction == "min"):
                            total = wp.where(weight > Real(0.0), wp.min(total, value), value)
                            weight = Real(1.0)
                        else:
                            total += value
                            weight = Real(1.0)
            if wp.static(not discards):
                if weight > Real(0.0):
                    result[node] = Dof(to_dof(total / weight))

        return wp.kernel(values_at_nodes)


def _conversion(plan, space):
    """A function from the integrand's result to values of a space."""
    from warp import extend

    Value, result = space.dtype, plan.result
    if extend.types_equal(Value, result):
        return _same
    if extend.type_size(Value) != extend.type_size(result):
        raise ValueError(
            f"integrand '{plan.record.integrand.name}' gives '{extend.type_repr(result)}', but "
            f"values of the space are '{extend.type_repr(Value)}'"
        )

    @wp.func
    def converted(x: result):
        return Value(x)

    return converted


def dof_value_function(space):
    """The function of a value that is the degree of freedom of a node."""
    return _same if space.mapper is None else space.functions.to_dof


@wp.func
def _same(value: Any):
    return value
