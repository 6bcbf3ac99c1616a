"""Variations - derivatives of forms by a field, in the direction of a test or trial function.

The form becomes a function of the slots of the field; its gradient by them, times the slots of the
direction, is the variation. A chain of variations (energy, residual, tangent) nests gradients.
"""

from __future__ import annotations

import functools

import warp as wp
from warp import extend
from warp._src.fem.forms.integrand import Integrand


class Variation(Integrand):
    """The derivative of an integrand by a field.

    Attributes:
        base: the integrand, or a variation. field: name of its field.
        direction: name of the new field: a test or a trial function of the field's space.
        root: the integrand of the chain. steps: pairs of field and direction, first the innermost.
    """

    def __init__(self, base: Integrand, field: str, direction: str):
        wp.Function.__init__(self, base.func, key=f"{base.key}_by_{field}")
        self.base, self.field, self.direction = base, field, direction
        self.root = getattr(base, "root", base)
        self.steps = (*getattr(base, "steps", ()), (field, direction))
        self.sample_name, self.domain_name = base.sample_name, base.domain_name
        self.field_names = [*base.field_names, direction]
        self.value_types, self.kernel_options = base.value_types, base.kernel_options
        self.parameter_names = base.parameter_names


@functools.cache
def derivative(form, field: str, direction: str | None = None) -> Variation:
    """The derivative of a form by one of its fields.

    Args:
        form: an integrand, or the result of a `derivative`.
        field: name of the field, a discrete one when the form is integrated.
        direction: name of the direction, a test or trial function of the field's space; by default
            the field's name after a "d", or two for a second derivative.

    Returns:
        A form with one field more.

    Raises:
        ValueError: the form has no such field, or has one of the direction's name.

    Example:
        >>> import warp as wp
        >>> from warp import fem
        >>> @fem.integrand
        ... def energy(s: fem.Sample, u: fem.Field):
        ...     return 0.25 * u(s) * u(s) * u(s) * u(s)
        >>> residual = fem.derivative(energy, "u", "v")
        >>> tangent = fem.derivative(residual, "u", "w")
        >>> tangent.field_names
        ['u', 'v', 'w']
    """
    if not isinstance(form, Integrand):
        raise ValueError(
            f"'derivative' expects a function decorated by `@fem.integrand`, but got "
            f"{extend.shown(form)}"
        )
    if field not in form.field_names:
        raise ValueError(
            f"integrand '{form.name}' has no field '{field}', but {form.field_names or 'none'}"
        )
    if direction is None:
        direction = f"d{field}"
        while direction in form.field_names:
            direction = f"d{direction}"
    if direction in form.field_names:
        raise ValueError(f"integrand '{form.name}' has a field '{direction}' already")
    return Variation(form, field, direction)


def variation_text(plan, arguments: str, parameters: str) -> str:
    """Text of `form` for a chain of variations; makes the functions that it calls.

    Args:
        plan: the plan; `discrete`, `test` and `trial` are its roles.
        arguments: of the root integrand, with parameters in place of the fields' slots.
        parameters: of the test and trial function's slots, as text.
    """
    steps = plan.record.integrand.steps
    fields = list(dict.fromkeys(field for field, _ in steps))
    slots = {name: plan._slot_names(plan.discrete[name]) for name in fields}
    common = "s: Sample, domain_arg: DomainArg, fields: Fields, values: Values, points: Any"
    rest = "s, domain_arg, fields, values, points"
    virtual = "".join(f"{name}, " for name, _ in plan.slot_parameters)

    def ordered(first):
        return [first, *(name for name in fields if name != first)]

    def names(order):
        return "".join(f"{name}, " for field in order for name, _ in slots[field])

    def declared(order):
        return "".join(f"{n}: {t}, " for field in order for n, t in slots[field])

    body = f"return INTEGRAND({arguments})"
    for level, (field, direction) in enumerate(steps):
        order = ordered(field)
        plan.names[f"level_{level}"] = plan._function(
            f"def level_{level}({declared(order)}{parameters}{common}):\n    {body}\n"
        )
        count = len(slots[field])
        body = (
            f"found = gradient_by(level_{level}, {count})({names(order)}{virtual}{rest})\n"
            f"    return {_product(plan, field, direction)}"
        )
    place = {name: k for k, name in enumerate(plan.discrete)}
    lines = [f"def form({parameters}{common}):"]
    for field in fields:
        for name, _ in slots[field]:
            number = name.rsplit("_", 1)[1]
            lines.append(f"    {name} = points[{place[field]}][{number}]")
    lines.append(f"    {body}")
    return "\n".join(lines) + "\n"


def _product(plan, field, direction) -> str:
    """The gradient by a field's slots times the slots of a direction."""
    role = next(r for r in (plan.test, plan.trial) if r is not None and r.name == direction)
    terms = []
    for k, (number, slot) in enumerate(plan.discrete[field].used_slots):
        one, other = f"found[{k}]", f"{role.role}_{number}"
        if extend.type_is_matrix(slot.type):
            terms.append(f"wp.ddot({one}, {other})")
        elif extend.type_is_vector(slot.type):
            terms.append(f"wp.dot({one}, {other})")
        else:
            terms.append(f"{one} * {other}")
    return " + ".join(terms) or "Real(0.0)"


def check_directions(plan) -> None:
    """Raises: a field or a direction of a variation is of another kind or space."""
    roles = {role.name: role for role in (plan.test, plan.trial) if role is not None}
    name = plan.record.integrand.name
    for field, direction in plan.record.integrand.steps:
        if field not in plan.discrete:
            raise ValueError(f"'{name}' expects a discrete field as '{field}'")
        role, own = roles.get(direction), plan.discrete[field].nodes
        if role is None:
            raise ValueError(f"'{name}' expects a test or trial function as '{direction}'")
        if role.nodes.values != own.values or role.nodes.cell_dimension != own.cell_dimension:
            raise ValueError(
                f"'{direction}' expects a function of the values of '{field}', "
                f"'{extend.type_repr(own.values.value)}', but has "
                f"'{extend.type_repr(role.nodes.values.value)}'"
            )
