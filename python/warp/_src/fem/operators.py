"""Operators - functions of fields and domains in integrands."""

from __future__ import annotations

from warp import extend
from warp._src.fem.forms.integrand import integrand
from warp._src.fem.linalg import skew_part, symmetric_part
from warp._src.fem.types import Domain, Field, Sample, make_free_sample

Operator = extend.Operator

# Operators of domains.
position = Operator("position", "Position in space of a sample; `domain(s)`.")
normal = Operator("normal", "Unit normal of a side, from the inner to the outer cell.")
deformation_gradient = Operator(
    "deformation_gradient", "Derivative of the position by reference coordinates."
)
lookup = Operator("lookup", "Sample at, or closest to, a position: `lookup(domain, x, ...)`.")
partition_lookup = Operator("partition_lookup", "As `lookup`, among the cells of the partition.")
measure = Operator("measure", "Volume, area or length of the element, by its map at the sample.")
measure_ratio = Operator("measure_ratio", "Ratio of the measures of a side and its cells, at most.")
element_closest_point = Operator(
    "element_closest_point", "Coordinates in an element of the closest point, and its distance."
)
element_coordinates = Operator(
    "element_coordinates", "Coordinates of a position, which may be outside of the element."
)
element_index = Operator("element_index", "Number in the geometry of an element of the domain.")
element_partition_index = Operator(
    "element_partition_index", "Number in the partition of an element of the geometry."
)
environment_index = Operator("environment_index", "Environment of the sample's element.")
cells = Operator("cells", "The cells of a domain of sides; the field in cells of a trace.")
scalar_type = Operator("scalar_type", "Scalar type of the geometry, to convert numbers to.")
_inner_cell_index = Operator("inner_cell_index")
_outer_cell_index = Operator("outer_cell_index")
_inner_cell_coords = Operator("inner_cell_coords")
_outer_cell_coords = Operator("outer_cell_coords")
_cell_to_element_coords = Operator("cell_to_element_coords")

# Operators of fields. On sides, the normal goes from the inner to the outer cell.
inner = Operator("inner", "Value of a field, of the inner cell on sides; `f(s)`.")
grad = Operator("grad", "Gradient of a field by position.")
div = Operator("div", "Divergence of a field.")
_curl_grad = Operator("curl_grad")
outer = Operator("outer", "Value in the outer cell of a side, which is the inner one on borders.")
grad_outer = Operator("grad_outer", "Gradient in the outer cell of a side.")
div_outer = Operator("div_outer", "Divergence in the outer cell of a side.")
degree = Operator("degree", "Polynomial degree of a field.")
node_count = Operator("node_count", "Number of nodes of the sample's element.")
at_node = Operator("at_node", "The sample moved to a node of the element.")
node_index = Operator("node_index", "Number of a node of the element.")
node_inner_weight = Operator("node_inner_weight", "Basis function of a node.")
node_outer_weight = Operator("node_outer_weight", "Basis function of a node of the outer cell.")
node_inner_weight_gradient = Operator(
    "node_inner_weight_gradient", "Gradient of the basis function of a node."
)
node_outer_weight_gradient = Operator(
    "node_outer_weight_gradient", "Gradient of the basis function of a node of the outer cell."
)
node_partition_index = Operator(
    "node_partition_index", "Number of a node in the partition of the field's space."
)


@integrand
def to_inner_cell(domain: Domain, s: Sample):
    """The sample of the inner cell at a sample of a side."""
    return make_free_sample(
        _inner_cell_index(domain, s.element_index),
        _inner_cell_coords(domain, s.element_index, s.element_coords),
    )


@integrand
def to_outer_cell(domain: Domain, s: Sample):
    """The sample of the outer cell at a sample of a side."""
    return make_free_sample(
        _outer_cell_index(domain, s.element_index),
        _outer_cell_coords(domain, s.element_index, s.element_coords),
    )


@integrand
def to_cell_side(domain: Domain, cell_s: Sample, side_index: int):
    """The sample of a side at a sample of a cell; coordinates are `OUTSIDE` off the side."""
    return make_free_sample(
        side_index,
        _cell_to_element_coords(domain, side_index, cell_s.element_index, cell_s.element_coords),
    )


@integrand
def D(f: Field, s: Sample):
    """Symmetric part of the gradient."""
    return symmetric_part(grad(f, s))


@integrand
def curl(f: Field, s: Sample):
    """Vector of the skew part of the gradient, which is half of the curl."""
    return skew_part(_curl_grad(f, s))


@integrand
def jump(f: Field, s: Sample):
    """Inner value minus outer value; zero inside of elements and on borders."""
    return inner(f, s) - outer(f, s)


@integrand
def average(f: Field, s: Sample):
    """Mean of the inner and the outer value."""
    return s.element_coords.dtype(0.5) * (inner(f, s) + outer(f, s))


@integrand
def grad_jump(f: Field, s: Sample):
    """Inner gradient minus outer gradient; zero inside of elements and on borders."""
    return grad(f, s) - grad_outer(f, s)


@integrand
def grad_average(f: Field, s: Sample):
    """Mean of the inner and the outer gradient."""
    return s.element_coords.dtype(0.5) * (grad(f, s) + grad_outer(f, s))
