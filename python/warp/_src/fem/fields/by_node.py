"""Test and trial functions by node - the basis function that the sample names."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.fields.base import NodesDescription, References
from warp._src.fem.fields.node_operators import discrete_node_functions
from warp._src.fem.fields.nodes import locations, signed_weights


@dataclass(frozen=True)
class NodeDescription(NodesDescription):
    """A test or trial function at the node and component of a sample's degree of freedom.

    Its parts are (0, node argument, geometry). It is 0 at samples that name no node.
    """

    nodes: object
    domain: object
    role: str

    def reference(self, one_node=False):
        """Functions of reference values."""
        if one_node:
            raise TypeError(f"a {self.role} function takes no node, which its sample names")
        return References(*(_reference(self, half) for half in (0, 1)))

    def node_functions(self):
        """Operators of nodes, for the node of the sample."""
        return _node_functions(self)

    def __str__(self):
        return f"{self.role} function of {self.nodes} ({self.domain.kind})"


@functools.cache
def dof_of(role):
    """A function of a sample: its degree of freedom of a role."""
    if role == "test":

        @wp.func
        def dof(s: Any):
            return s.test_dof

    else:

        @wp.func
        def dof(s: Any):
            return s.trial_dof

    return dof


def _unit(values):
    """A function of (number or vector, component): a degree of freedom, or a row per component."""
    Dof = values.dof
    if extend.type_is_matrix(Dof):
        Flat = wp.types.vector(extend.type_size(Dof), extend.type_scalar_type(Dof))
        columns = Dof._shape_[1]

        @wp.func
        def unit_matrix(basis: Any, component: int):
            dof = Dof()
            dof[component // columns, component % columns] = basis
            return dof

        @wp.func
        def unit_matrix_gradient(basis: Any, component: int):
            dof = Flat()
            dof[component] = basis.dtype(1.0)
            return wp.outer(dof, basis)

        return unit_matrix, unit_matrix_gradient
    if values.map != "identity" or not extend.type_is_vector(Dof):

        @wp.func
        def unit(basis: Any, component: int):
            return basis

        return unit, unit

    @wp.func
    def unit_value(basis: Any, component: int):
        dof = Dof()
        dof[component] = basis
        return dof

    @wp.func
    def unit_gradient(basis: Any, component: int):
        dof = Dof()
        dof[component] = basis.dtype(1.0)
        return wp.outer(dof, basis)

    return unit_value, unit_gradient


def _reference(description, half) -> SimpleNamespace:
    nodes, domain = description.nodes, description.domain
    at, dof_of_sample = locations(domain, half), dof_of(description.role)
    cell_arg, cell, coords = at.cell_arg, at.cell, at.coords
    weight, weight_gradient = signed_weights(nodes)
    unit_value, unit_gradient = _unit(description.values)
    Value, Gradient = description.values.reference_types(nodes.cell_dimension)
    first = nodes.node_count * half
    last = first + nodes.node_count

    def at_node(Type, basis_function, unit):
        @wp.func
        def of_node(part: Any, arg: Any, geo: Any, s: Any):
            dof = dof_of_sample(s)
            found = Type()
            if dof[0] >= first and dof[0] < last:
                k = dof[0] - first
                basis = basis_function(cell_arg(geo), arg.topology, cell(geo, s), coords(geo, s), k)
                found = unit(basis, dof[1])
            return found

        return of_node

    return SimpleNamespace(
        value=at_node(Value, weight, unit_value),
        gradient=at_node(Gradient, weight_gradient, unit_gradient),
    )


@functools.cache
def _node_functions(description) -> SimpleNamespace:
    """The operators of nodes of discrete fields for the node of the sample."""
    of_discrete = discrete_node_functions(description.nodes, description.domain)
    dof_of_sample = dof_of(description.role)
    at_discrete, node_count = of_discrete.at_node, of_discrete.node_count

    @wp.func
    def at_node(part: Any, arg: Any, geo: Any, s: Any):
        moved = at_discrete(part, arg, geo, s, dof_of_sample(s)[0])
        moved.qp_index = s.qp_index
        moved.qp_weight = s.qp_weight
        moved.test_dof = s.test_dof
        moved.trial_dof = s.trial_dof
        return moved

    made = SimpleNamespace(at_node=at_node, node_count=node_count)
    made.node_partition_index = of_discrete.node_partition_index
    for name in (
        "node_index",
        "node_inner_weight",
        "node_outer_weight",
        "node_inner_weight_gradient",
        "node_outer_weight_gradient",
    ):
        setattr(made, name, _of_sample(getattr(of_discrete, name), dof_of_sample))
    return made


def _of_sample(function, dof_of_sample):
    @wp.func
    def of_sample(part: Any, arg: Any, geo: Any, s: Any):
        return function(part, arg, geo, s, dof_of_sample(s)[0])

    return of_sample
