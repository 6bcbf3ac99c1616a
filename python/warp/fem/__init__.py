"""Finite elements: forms over fields, assembled, matrix-free and differentiated.

A form is a function with the decorator `integrand`. Geometries have function spaces, spaces have
fields; `integrate` makes numbers, vectors and matrices of forms, `interpolate` evaluates them.
Names are loaded when they are used.
"""

import importlib as _importlib
import typing as _typing

# Names by the module that defines them, below `warp._src.fem`.
_SOURCES = {
    "adaptivity": "adaptive_nanogrid_from_field adaptive_nanogrid_from_hierarchy",
    "cells.cell": "Element",
    "cells.element": "ElementBasis",
    "cells.polynomial": "Polynomial",
    "forms.variation": "derivative",
    "dirichlet": "dirichlet normalize_dirichlet_projector project_linear_system "
    "project_system_matrix project_system_rhs",
    "domains": "BoundarySides Cells FrontierSides GeometryDomain Sides Subdomain",
    "fields.base": "FieldLike GeometryField",
    "fields.discrete": "DiscreteField make_discrete_field make_restriction",
    "fields.implicit": "ImplicitField",
    "fields.nonconforming": "NonconformingField",
    "fields.uniform": "UniformField",
    "fields.virtual": "make_test make_trial",
    "forms.integrand": "Integrand integrand",
    "geometry.adaptive": "AdaptiveNanogrid",
    "geometry.base": "Geometry",
    "geometry.files": "read_mesh",
    "geometry.grid": "Grid2D Grid3D",
    "geometry.meshes": "Hexmesh Quadmesh2D Quadmesh3D Tetmesh Trimesh2D Trimesh3D",
    "geometry.nanogrid": "Nanogrid",
    "geometry.partition": "CellBasedGeometryPartition ExplicitGeometryPartition "
    "GeometryPartition LinearGeometryPartition",
    "integrate": "integrate",
    "interpolate": "interpolate",
    "operator": "operator pattern",
    "operators": "D Operator at_node average cells curl deformation_gradient degree div div_outer "
    "element_closest_point element_coordinates element_index element_partition_index "
    "environment_index grad grad_average grad_jump grad_outer inner jump lookup measure "
    "measure_ratio node_count node_index node_inner_weight node_inner_weight_gradient "
    "node_outer_weight node_outer_weight_gradient node_partition_index normal outer "
    "partition_lookup position scalar_type to_cell_side to_inner_cell to_outer_cell",
    "pic_quadrature": "PicQuadrature",
    "quadratures": "ExplicitQuadrature NodalQuadrature Quadrature RegularQuadrature",
    "spaces.basis": "BasisSpace ShapeBasisSpace",
    "spaces.make": "make_collocated_function_space make_contravariant_function_space "
    "make_covariant_function_space make_polynomial_basis_space make_polynomial_space",
    "spaces.mappers": "DofMapper SkewSymmetricTensorMapper SymmetricTensorMapper",
    "spaces.partition": "SpacePartition make_space_partition",
    "spaces.points": "PointBasisSpace",
    "spaces.restriction": "SpaceRestriction make_space_restriction",
    "spaces.shapes": "ShapeFunction make_element_shape_function",
    "spaces.space": "FunctionSpace",
    "spaces.topology": "SpaceTopology make_element_based_space_topology",
    "temporaries": "Temporary TemporaryStore borrow_temporary borrow_temporary_like "
    "set_default_temporary_store",
    "types": "Coords Coords_f64 Domain ElementIndex ElementKind Field NULL_ELEMENT_INDEX "
    "NULL_NODE_INDEX NULL_QP_INDEX NodeIndex OUTSIDE QuadraturePointIndex Sample Sample_f64 "
    "make_free_sample",
}
_MODULES = ("cache", "field", "geometry", "linalg", "polynomial", "space", "utils")
_WHERE = {name: module for module, names in _SOURCES.items() for name in names.split()}

__all__ = [*_WHERE, *_MODULES]


def __getattr__(name) -> _typing.Any:
    if name in _MODULES:
        return _importlib.import_module(f"warp.fem.{name}")
    module = _WHERE.get(name)
    if module is None:
        raise AttributeError(f"module 'warp.fem' has no attribute '{name}'")
    value = getattr(_importlib.import_module(f"warp._src.fem.{module}"), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
