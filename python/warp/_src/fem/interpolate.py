"""Interpolation - values of integrands at nodes, quadrature points, elements or free samples."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.domains import Cells, GeometryDomain
from warp._src.fem.fields.base import GeometryField
from warp._src.fem.fields.discrete import DiscreteField, FieldRestriction
from warp._src.fem.forms.form import Form
from warp._src.fem.forms.integrand import integrand as make_integrand
from warp._src.fem.quadratures import Quadrature
from warp._src.fem.types import Field, Sample

_REDUCTIONS = ("weighted_average", "mean", "sum", "max", "min", "first")


@make_integrand
def field_value(field: Field, s: Sample):
    """The value of a field."""
    return field(s)


def interpolate(
    integrand,
    dest=None,
    at=None,
    dest_space=None,
    dim=None,
    fields=None,
    values=None,
    reduction="weighted_average",
    device=None,
    kernel_options=None,
    temporary_store=None,
    bsr_options=None,
):
    """Evaluates an integrand, or a field, at nodes, points, elements or free samples.

    Args:
        integrand: decorated by `fem.integrand`, or a field.
        dest: a discrete field or the restriction of one, whose nodes are the places; an array; a
            matrix, which gets the derivative by the trial function; None to drop values.
        at: a quadrature, a space restriction, or a domain: its nodes if there is a space, else
            its elements, or `dim` samples without a place.
        dest_space: space of the nodes, if `dest` is no field.
        dim: number of samples without a place; the integrand has their number in `s.qp_index`.
        fields, values: arguments of the integrand, by name.
        reduction: of values at a node from several elements: "weighted_average" (by measure),
            "mean", "sum", "max", "min" or "first".
        device: where it is evaluated.
        kernel_options: options of kernels.
        bsr_options: how a matrix is filled.

    Raises:
        ValueError: arguments do not fit each other; says which.
    """
    if reduction not in _REDUCTIONS:
        raise ValueError(f"'reduction' expects one of {_REDUCTIONS}, but got {reduction!r}")
    if isinstance(integrand, GeometryField):
        integrand, fields, values = field_value, {"field": integrand}, {}
    fields = dict(fields or {})
    trial = next((f for f in fields.values() if getattr(f, "role", "") == "trial"), None)
    place = Place(dest, at, dest_space, dim, trial, device)
    form = Form(
        integrand, place.domain, place.quadrature, fields, values, device, kernel_options,
        "interpolate",
    )  # fmt: skip
    if form.test is not None:
        raise ValueError(
            f"test function '{form.test_name}' cannot be used for interpolation, but in 'integrate'"
        )
    is_matrix = hasattr(dest, "row_counts") and hasattr(dest, "offsets")
    if trial is not None and not is_matrix:
        raise ValueError(
            f"trial function '{form.trial_name}' expects a 'BsrMatrix' as 'dest', but got "
            f"{extend.shown(dest)}"
        )
    if is_matrix:
        if trial is None:
            raise ValueError("a 'BsrMatrix' as 'dest' expects a trial function among the fields")
        from warp._src.fem.assembly.jacobian import interpolate_jacobian

        return interpolate_jacobian(form, place, dest, reduction, bsr_options)
    from warp._src.fem.forms.values import ValuesPlan

    plan = ValuesPlan.of(form.record)
    args = form.arguments(plan)
    if place.restriction is not None:
        return _at_nodes(form, plan, place, args, reduction)
    target = place.dest
    result = plan.result if target is None else extend.canonical(target.dtype)
    if place.quadrature is not None:
        kernel, count = plan.at_points(result, target is not None), form.domain.element_count()
    else:
        kernel, count = plan.at_samples(result, target is not None), dim
        args = [dim, *args]
    if target is None:
        target = wp.empty(0, dtype=result or wp.float32, device=form.device)
    wp.launch(kernel, count, args, [target], device=form.device)
    return None


def _at_nodes(form, plan, place, args, reduction):
    """Values at the nodes of a restriction."""
    restriction, space, device = place.restriction, place.space, form.device
    target, incidence = place.dest, restriction.incidence
    if isinstance(target, DiscreteField):
        target = target.dof_values
    dtype = None if target is None else extend.canonical(target.dtype)
    count = incidence.begins.shape[0] - 1
    if target is None:
        target = wp.empty(0, dtype=space.dof_dtype, device=device)
    elif target.shape[0] < count:
        raise ValueError(f"'dest' expects {count} values, one per node, but got {target.shape[0]}")
    kernel = plan.at_nodes(place.node_record, reduction, dtype)
    topology = restriction.space_topology.topo_arg_value(device)
    inputs = [incidence.begins, incidence.positions, topology, *args]
    wp.launch(kernel, count, inputs, [target], device=device)


class Place:
    """The samples of an interpolation: one of nodes, points and free samples.

    Attributes:
        domain: elements. restriction, space: the nodes, or None. quadrature: the points, or None.
        dest: array or field.
    """

    def __init__(self, dest, at, dest_space, dim, trial, device):
        self.domain = self.restriction = self.quadrature = None
        self.space, self.dest = dest_space, dest
        if isinstance(dest, FieldRestriction):
            self.restriction, self.dest = dest.space_restriction, dest.field
        elif hasattr(at, "space_partition") and hasattr(at, "domain"):
            self.restriction = at
            if dest_space is None and not isinstance(dest, DiscreteField):
                raise ValueError("expects 'dest_space' for the nodes of a space restriction")
        elif isinstance(at, Quadrature):
            self.quadrature = at
        elif isinstance(at, GeometryDomain) or at is None:
            self._at_domain(at, dim, trial, device)
        else:
            raise ValueError(
                "'at' expects a quadrature, a space restriction or a domain, but got "
                f"{extend.shown(at)}"
            )
        if isinstance(self.dest, DiscreteField):
            self.space = self.dest.space
        if self.restriction is not None:
            self.domain = self.restriction.domain
        elif self.quadrature is not None:
            self.domain = self.quadrature.domain

    def _at_domain(self, domain, dim, trial, device):
        """Nodes, elements or free samples of a domain."""
        from warp._src.fem.quadratures import RegularQuadrature
        from warp._src.fem.spaces.restriction import make_space_restriction

        if domain is None and trial is not None:
            domain = trial.domain
        if isinstance(self.dest, DiscreteField):
            if domain is None and self.dest.kind == "sides":
                from warp._src.fem.domains import Sides

                domain = Sides(self.dest.geometry)
            self.restriction = make_space_restriction(
                space_partition=self.dest.space_partition, domain=domain, device=device
            )
        elif self.space is not None:
            if domain is None:
                domain = Cells(self.space.geometry)
            self.restriction = make_space_restriction(
                space_topology=self.space.topology, domain=domain, device=device
            )
        elif domain is None:
            raise ValueError("expects one of 'at', 'dest_space' and a field as 'dest'")
        elif dim is None:
            self.quadrature = RegularQuadrature(domain, order=0)
        self.domain = domain

    @property
    def node_record(self):
        """Record of the space on elements of the domain's kind."""
        space = self.space
        return (space.cell_space if self.domain.is_cells else space.trace()).record
