"""Integration of forms - functionals, vectors of linear forms, matrices of bilinear forms."""

from __future__ import annotations

import warp as wp
from warp import extend
from warp._src.fem.forms.form import Form

_ASSEMBLIES = (None, "dispatch", "generic", "nodal")
# Kinds of geometries whose cells may be bad.
_CHECKED = ("mesh", "deformed")


def integrate(
    integrand,
    domain=None,
    quadrature=None,
    fields=None,
    values=None,
    accumulate_dtype=wp.float64,
    output_dtype=None,
    output=None,
    device=None,
    temporary_store=None,
    kernel_options=None,
    assembly=None,
    add=False,
    bsr_options=None,
):
    """Integrates a form: a number, a vector or a sparse matrix.

    Args:
        integrand: the form, decorated by `fem.integrand`.
        domain: elements to integrate over; by default those of `quadrature` or the test function.
        quadrature: points and weights; by default a rule that is exact for the product of the
            fields on affine elements.
        fields: fields by name of their parameter. With a test function the result is a vector,
            with a trial function, too, a matrix.
        values: arguments of the other parameters, by name.
        accumulate_dtype: scalar type of sums over elements.
        output_dtype: type of the result, by default the form's.
        output: array or matrix for the result. A functional is written to its first element.
        device: where the form is integrated.
        temporary_store: where element vectors and matrices come from.
        kernel_options: options of kernels, beside those of the integrand.
        assembly: "dispatch" evaluates the form once per point, "generic" for each pair of nodes,
            "nodal" at the nodes of the test function, so that matrices are diagonal. None takes
            "dispatch" unless the form applies operators of nodes to test or trial function.
        add: adds the result to `output`.
        bsr_options: how a matrix is filled, see `warp.sparse`.

    Returns:
        The number, if there is no test function and no `output`; an array with a value per node;
        a `BsrMatrix`.

    Raises:
        ValueError: fields, values, domain or options do not fit the integrand or each other.
        WarpCodegenError: the integrand cannot be translated, or is not linear in the test or
            trial function.
    """
    if assembly not in _ASSEMBLIES:
        raise ValueError(
            f"'assembly' expects 'dispatch', 'generic', 'nodal' or None, but got {assembly!r}"
        )
    form = form_of(integrand, domain, quadrature, fields, values, device, kernel_options, assembly)
    geometry = form.domain.geometry
    if geometry.record.kind in _CHECKED and "_is_checked" not in vars(geometry):
        from warp._src.fem.geometry.check import warn_of_bad_cells

        warn_of_bad_cells(geometry, form.device)
    if form.trial is not None and form.test is None:
        raise ValueError(f"integrand '{integrand.name}' has a trial function, but no test function")
    if form.test is None:
        return _functional(form, accumulate_dtype, output_dtype, output, add)
    if form.trial is None:
        return _linear(form, accumulate_dtype, output_dtype, output, add, temporary_store)
    if assembly == "nodal":
        from warp._src.fem.assembly.vector import assemble_diagonal

        return assemble_diagonal(form, output, output_dtype, accumulate_dtype, add)
    from warp._src.fem.assembly.matrix import assemble_matrix

    return assemble_matrix(
        form,
        output,
        output_dtype,
        accumulate_dtype=accumulate_dtype,
        add=add,
        bsr_options=bsr_options,
        temporary_store=temporary_store,
    )


def form_of(integrand, domain, quadrature, fields, *more) -> Form:
    """A form with its arguments, whose domain and quadrature may be left out."""
    fields = dict(fields or {})
    domain = _domain_of(domain, quadrature, fields)
    if quadrature is None:
        quadrature = _default_quadrature(Form(integrand, domain, None, fields, *more))
    return Form(integrand, domain, quadrature, fields, *more)


def _domain_of(domain, quadrature, fields):
    """The elements to integrate over."""
    from warp._src.fem.domains import GeometryDomain
    from warp._src.fem.fields.base import GeometryField
    from warp._src.fem.fields.virtual import VirtualField
    from warp._src.fem.quadratures import Quadrature

    if domain is not None and not isinstance(domain, GeometryDomain):
        raise ValueError(
            "'domain' expects a domain such as `fem.Cells(geometry)`, but got "
            f"{extend.shown(domain)}"
        )
    if quadrature is not None and not isinstance(quadrature, Quadrature):
        raise ValueError(
            "'quadrature' expects a rule such as `fem.RegularQuadrature(domain, order)`, but got "
            f"{extend.shown(quadrature)}"
        )
    virtual = [field for field in fields.values() if isinstance(field, VirtualField)]
    given = [one for one in (domain, quadrature and quadrature.domain) if one is not None]
    given += [field.domain for field in virtual]
    if not given:
        others = [name for name in fields if not isinstance(fields[name], GeometryField)]
        shown = "".join(f", but '{n}' is {extend.shown(fields[n])}, no field" for n in others[:1])
        raise ValueError(f"expects one of 'domain', 'quadrature' and a test function{shown}")
    for other in given[1:]:
        if other != given[0]:
            where = "" if other.geometry == given[0].geometry else " of another geometry"
            raise ValueError(
                f"the form is integrated over '{given[0].name}', but a quadrature, test or trial "
                f"function is defined on '{other.name}'{where}"
            )
    return given[0]


def _default_quadrature(form):
    """The rule for a form without one: exact for the product of its fields, and for the integrand
    where that is a polynomial in reference coordinates, or is one in each half of a cell."""
    from warp._src.fem.quadratures import RegularQuadrature

    domain = form.domain
    if form.assembly == "nodal":
        from warp._src.fem.quadratures import NodalQuadrature

        if form.test is None:
            raise ValueError("assembly='nodal' expects a test function")
        return NodalQuadrature(domain=domain, space=form.test.space)
    order = sum(field.degree for field in form.fields.values())
    degree = form.degree
    if degree is not None:
        is_simple = domain.geometry.is_affine and domain.is_cells and domain.cell.is_simplex
        order = degree if is_simple else max(order, degree)
    kept = domain.__dict__.setdefault("_default_rules", {})
    halves = any(map(_breaks_in_cells, form.fields.values()))
    if (order, halves) not in kept:
        kept[order, halves] = RegularQuadrature(domain, order, halves=halves)
    return kept[order, halves]


def _breaks_in_cells(field) -> bool:
    """True for splines of even degree, whose pieces end at centres of cells."""
    from warp._src.fem.cells.element import ElementBasis

    element = getattr(getattr(getattr(field, "space", None), "record", None), "element", None)
    return element is not None and element.basis is ElementBasis.BSPLINE and element.degree % 2 == 0


def _functional(form, accumulate_dtype, output_dtype, output, add):
    """The integral of a form without test function."""
    result = form.plan.total_type
    totals = wp.empty(
        form.domain.element_count(), dtype=result, device=form.device,
        requires_grad=form.requires_grad and extend.is_recording(),
    )  # fmt: skip
    form.totals(totals)
    from warp._src.fem.assembly.functional import sum_totals

    return sum_totals(totals, accumulate_dtype, output_dtype or result, output, add)


def _linear(form, accumulate_dtype, output_dtype, output, add, temporary_store):
    """The vector of a linear form."""
    from warp._src.fem.assembly.gather import with_scalar
    from warp._src.fem.assembly.vector import as_vector, assemble_vector

    count = form.test.space_partition.node_count()
    if output is None:
        if add:
            raise ValueError("add=True expects 'output'")
        block = form.block_dtype
        scalar = extend.canonical(output_dtype or extend.type_scalar_type(block))
        if extend.type_is_vector(scalar):
            scalar = extend.type_scalar_type(scalar)
        output = wp.empty(
            count, dtype=with_scalar(block, scalar), device=form.device,
            requires_grad=form.requires_grad and extend.is_recording(),
        )  # fmt: skip
    target = as_vector(output, form.block_dtype, count)
    assemble_vector(
        form, target, accumulate_dtype=accumulate_dtype, add=add, temporary_store=temporary_store
    )
    return output
