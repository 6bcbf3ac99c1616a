"""Forms - an integrand with the domain, points, fields and values that it is evaluated with."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import warp as wp
from warp import extend
from warp._src.fem.fields.base import GeometryField
from warp._src.fem.fields.virtual import TestField, TrialField
from warp._src.fem.forms.facts import value_types
from warp._src.fem.forms.integrand import Integrand
from warp._src.fem.forms.tables import node_table
from warp._src.fem.kept import hashed, record_of


@hashed
@dataclass(frozen=True)
class FormRecord:
    """All of a form that its kernels depend on.

    Attributes:
        integrand: the function. domain, quadrature: records; quadrature None for nodes.
        rule: points and weights if all elements share them.
        fields: (name, description, type of the argument) of fields with values.
        values: (name, type) of values; the type of a function is None.
        functions: (name, function) of values that are functions.
        test, trial: (name, `NodeSpace`) or None.
        options: (name, value) of kernel options.
    """

    integrand: Integrand
    domain: object
    quadrature: object
    rule: object = None
    fields: tuple = ()
    values: tuple = ()
    functions: tuple = ()
    test: tuple | None = None
    trial: tuple | None = None
    options: tuple = ()

    @property
    def scalar(self):
        """Scalar type of the geometry."""
        return self.domain.geometry.scalar


def _has_gradient(value) -> bool:
    """True if an array, or one in a struct, has a gradient."""
    if extend.is_array(value):
        return value.requires_grad
    if extend.type_is_struct(type(value)):
        return any(_has_gradient(getattr(value, name)) for name in type(value).vars)
    return False


class Form:
    """A form with its arguments.

    Attributes:
        record: what its kernels depend on. domain, quadrature, device: where it is evaluated.
        test, trial: fields or None.
    """

    def __init__(
        self,
        integrand,
        domain,
        quadrature,
        fields,
        values,
        device,
        kernel_options=None,
        assembly=None,
    ):
        if not isinstance(integrand, Integrand):
            raise ValueError(
                "expects a function decorated by `@fem.integrand`, but got "
                f"{extend.shown(integrand)}"
            )
        self.integrand, self.domain, self.quadrature = integrand, domain, quadrature
        self.assembly = assembly
        self.device = wp.get_device(device)
        self.fields, self.values = dict(fields or {}), dict(values or {})
        self.test = self.trial = None
        self.test_name = self.trial_name = None
        self._sort_fields()
        types = value_types(integrand, self.values)
        discrete = tuple(
            (name, self._bound(field, domain), field.ArgType)
            for name, field in self.fields.items()
            if name not in (self.test_name, self.trial_name)
        )
        self.kernel_options = kernel_options
        options = {**integrand.kernel_options, **(kernel_options or {})}
        self.record = FormRecord(
            integrand,
            record_of(domain),
            None if quadrature is None else record_of(quadrature),
            None if quadrature is None else quadrature.rule,
            discrete,
            tuple((name, kind) for name, kind in types.items() if kind is not None),
            tuple((name, self.values[name]) for name, kind in types.items() if kind is None),
            self.test and (self.test_name, self.test.nodes),
            self.trial and (self.trial_name, self.trial.nodes),
            tuple(sorted(options.items())),
        )

    @staticmethod
    def _bound(field, domain):
        """The description of a field for elements of a domain, made once per field and domain."""
        record = record_of(domain)
        kept = field.__dict__.setdefault("_bound", {})
        if record not in kept:
            kept[record] = field.bind(record)
        return kept[record]

    def _sort_fields(self):
        """Checks the fields and finds test and trial function."""
        integrand, given = self.integrand, self.fields
        for name in integrand.field_names:
            if name not in given:
                raise ValueError(
                    f"integrand '{integrand.name}' expects a field '{name}', but got "
                    f"{sorted(given) or 'none'}"
                )
        for name, field in given.items():
            if name not in integrand.field_names:
                raise ValueError(
                    f"integrand '{integrand.name}' has no field '{name}', but "
                    f"{integrand.field_names or 'none'}"
                )
            if not isinstance(field, GeometryField):
                raise ValueError(
                    f"field '{name}' of '{integrand.name}' expects a field, but got "
                    f"{extend.shown(field)}"
                )
            if isinstance(field, TestField):
                self._set("test", name, field)
            elif isinstance(field, TrialField):
                self._set("trial", name, field)
        self.fields = {name: given[name] for name in integrand.field_names}
        for name, field in self.fields.items():
            self._check(name, field)

    def _set(self, role, name, field):
        other = getattr(self, f"{role}_name")
        if other is not None:
            raise ValueError(
                f"'{self.integrand.name}' expects one {role} function, but got '{other}' and "
                f"'{name}'"
            )
        setattr(self, role, field)
        setattr(self, f"{role}_name", name)

    def _check(self, name, field):
        domain = self.domain
        if field.geometry is not None and field.geometry != domain.geometry:
            raise ValueError(
                f"field '{name}' is defined on '{field.geometry.name}', but the form is integrated "
                f"over another geometry, '{domain.geometry.name}'"
            )
        kinds = {True: "cells", False: "sides"}
        kind = kinds[domain.is_cells]
        if field.geometry is not None and field.kind not in ("any", kind):
            hint = "; use its `.trace()`" if kind == "sides" else ""
            raise ValueError(
                f"field '{name}' is defined on {field.kind}, but the domain has {kind}{hint}"
            )

    @functools.cached_property
    def plan(self):
        """Kernels of the form."""
        from warp._src.fem.forms.pairs import PairsPlan
        from warp._src.fem.forms.points import NodeOperatorsError, PointsPlan

        if self.test is not None and self.assembly == "nodal":
            return PairsPlan.of(self.record, True)
        if self.test is not None and self.assembly == "generic":
            return PairsPlan.of(self.record)
        try:
            return PointsPlan.of(self.record)
        except NodeOperatorsError:
            if self.assembly == "dispatch":
                raise ValueError(
                    f"integrand '{self.integrand.name}' applies operators of nodes to a test or "
                    "trial function, which needs assembly='generic', not 'dispatch'"
                ) from None
            return PairsPlan.of(self.record)

    @property
    def degree(self):
        """Polynomial degree of the integrand in reference coordinates, None if not known."""
        from warp._src.fem.forms.points import NodeOperatorsError, PointsPlan

        try:
            return PointsPlan.of(self.record).structure.degree
        except NodeOperatorsError:
            return None

    @property
    def requires_grad(self) -> bool:
        """True if an array that the form depends on has a gradient."""
        return any(map(_has_gradient, self.arguments()))

    def arguments(self, plan=None) -> list:
        """The arguments that all kernels of the form share."""
        plan, device = plan or self.plan, self.device
        if plan.looks_up and not self.domain.cell_domain().supports_lookup(device):
            self.domain.geometry.build_bvh(device)
        domain = self.domain.domain_arg_value(device)
        quadrature = 0 if self.quadrature is None else self.quadrature.arg_value(device)
        fields, values = plan.Fields(), plan.Values()
        for name, _, _ in self.record.fields:
            setattr(fields, name, self.fields[name].arg_value(device))
        for name, field in (("test_", self.test), ("trial_", self.trial)):
            if field is not None:
                setattr(fields, name, field.arg_value(device))
        for name, _ in self.record.values:
            setattr(values, name, self.values[name])
        return [domain, quadrature, fields, values, plan.table_values(device)]

    @property
    def block_dtype(self):
        """Type of a block of the matrix, or of an element of the vector."""
        return self.plan.block_dtype

    @property
    def repeats(self) -> bool:
        """True if all elements have one matrix."""
        return self.plan.repeats

    @property
    def has_many_threads(self) -> bool:
        """True if a thread per element leaves the device without work."""
        return self.device.is_cuda

    def blocks(self, first, count, blocks):
        """Writes the blocks of elements [first, first + count) of the domain.

        Args:
            blocks: (count * test nodes * trial nodes,) of `block_dtype`, element by element.
        """
        shape = count
        by_rows = self.plan.row_blocks if self.plan.has_slots and self.has_many_threads else None
        if not self.plan.has_slots:
            shape = count, self.test.nodes.node_count * (1 if self.domain.is_cells else 2)
        elif by_rows is not None:
            shape = count, *by_rows[1]
        kernel = by_rows[0] if by_rows else self.plan.blocks
        args = [first, *self.arguments(), *self.plan.more_values(self.device)]
        wp.launch(kernel, shape, args, [blocks], device=self.device)

    def totals(self, totals):
        """Writes the integral over each element of the domain.

        Args:
            totals: (elements,) of the result's type.
        """
        wp.launch(
            self.plan.totals, self.domain.element_count(), self.arguments(), [totals],
            device=self.device,
        )  # fmt: skip

    def test_table(self, device=None):
        """Numbers of the test function's nodes, (elements, nodes), -1 where there is none."""
        return node_table(self.test, self.domain, self.device)

    def trial_table(self, device=None):
        """Numbers of the trial function's nodes, (elements, nodes), -1 where there is none."""
        return node_table(self.trial, self.domain, self.device)
