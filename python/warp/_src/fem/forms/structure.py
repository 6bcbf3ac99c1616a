"""Structure of a form - which coefficients are zero, and whether it is linear in its functions.

A kernel that stores the coefficients of the slots is translated, but not compiled: its IR has the
exact structure, since the derivative of what does not depend on a slot is the constant 0.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import warp as wp
from warp import extend
from warp._src.fem.forms.flow import UNKNOWN, Flow, FlowAnalysis
from warp._src.fem.forms.terms import components
from warp._src.fem.kept import function_of_text

_SAMPLE = ("element", *("coords",) * 3, "point", "weight", *("dof",) * 4)


@dataclass(frozen=True)
class Structure:
    """Facts of the coefficients of a form.

    Attributes:
        coefficients: facts by (slot and component of the test function[, those of the trial
            function]); None if they are not known.
        value: facts of the form.
    """

    coefficients: dict | None
    value: Flow | None

    def encoded(self) -> tuple:
        """The facts as plain values."""
        plain = {key: dataclasses.astuple(one) for key, one in (self.coefficients or {}).items()}
        value = None if self.value is None else dataclasses.astuple(self.value)
        return (None if self.coefficients is None else plain), value

    @staticmethod
    def decoded(made) -> Structure:
        """The structure that `encoded` was made of."""
        plain, value = made
        found = None if plain is None else {key: Flow(*one) for key, one in plain.items()}
        return Structure(found, None if value is None else Flow(*value))

    def is_zero(self, *key) -> bool:
        """True if a coefficient is 0."""
        return self.coefficients is not None and self.coefficients[key].is_zero

    @property
    def is_constant(self) -> bool:
        """True if coefficients are the same at all points of an element."""
        if self.coefficients is None:
            return False
        varying = {"coords", "point", "weight", "fields", "memory"}
        return all(varying.isdisjoint(one.on) for one in self.coefficients.values())

    @property
    def is_symmetric(self) -> bool:
        """True if the form is the same with both functions exchanged; they have one space."""
        found = self.coefficients
        if not found or len(next(iter(found))) != 4:
            return False
        return all(
            (c, d, a, b) in found and found[c, d, a, b].number == one.number
            for (a, b, c, d), one in found.items()
        )

    @property
    def degree(self):
        """Polynomial degree of the form in reference coordinates, None if it is not known."""
        if self.value is None or self.value.degree >= UNKNOWN:
            return None
        return self.value.degree


def _scalars(dtype) -> int:
    return extend.type_size(dtype)


def find_structure(plan) -> Structure:
    """The structure of the form of a plan by points.

    Raises:
        WarpCodegenError: the form is not linear in its test or trial function.
    """
    if plan.test is not None:
        plan.check_result()
    try:
        text, arguments, keys = _probe(plan)
        found = FlowAnalysis(text, arguments).stored
    except (NotImplementedError, StopIteration):
        return Structure(None, None)
    if len(found) != len(keys) + 1:
        return Structure(None, None)
    value = found.pop(len(keys))
    structure = Structure({key: found[i] for i, key in enumerate(keys)}, value)
    if plan.test is not None:
        _check_linear(plan, structure)
    return structure


def _check_linear(plan, structure):
    """Raises if coefficients depend on the functions, or if a term is without one of them."""
    # A variation is linear in its direction.
    directions = {name for _, name in getattr(plan.record.integrand, "steps", ())}
    for role in filter(None, (plan.test, plan.trial)):
        if role.name in directions:
            continue
        depends = any(role.role in one.on for one in structure.coefficients.values())
        lacks = not structure.value.is_zero and role.role not in structure.value.vanishes
        if depends or lacks:
            raise not_linear(plan, role, depends)


def not_linear(plan, role, depends):
    """The error of a form that is not linear in a function."""
    integrand = plan.record.integrand
    node = _place_of(extend.syntax_of(integrand.func), role.name)
    reason = "it is not linear" if depends else "a term does not depend on it"
    return wp.WarpCodegenError(
        f"form '{integrand.name}' is not linear in '{role.name}', its {role.role} function: "
        f"{reason}",
        hint=None if depends else "integrate that term by itself",
        **extend.place_of(integrand.func, node),
    )


def _place_of(tree, name):
    """The last statement that names a parameter, or the last one."""
    import ast

    found = tree.body[-1]
    for statement in tree.body:
        for node in ast.walk(statement):
            if isinstance(node, ast.Name) and node.id == name:
                found = statement
    return found


def _probe(plan):
    """IR of a kernel that stores coefficients and value, facts of its arguments, and keys."""
    record = plan.record
    arguments: list = []
    parameters = []
    for role in filter(None, (plan.test, plan.trial)):
        for number, slot in role.used_slots:
            parameters.append((f"{role.role}_{number}", f"Slot_{role.role}_{number}"))
            degree = plan.slot_degree(role, slot)
            group = frozenset((role.role,))
            arguments += [Flow(group, False, group, degree)] * _scalars(slot.type)
    points = []
    for role in plan.discrete.values():
        plan._slots(role)
        used = dict(role.used_slots)
        for number, slot in used.items():
            parameters.append((f"{role.role}_{number}", f"Slot_{role.role}_{number}"))
            facts = Flow(frozenset(("fields",)), False, frozenset(), plan.slot_degree(role, slot))
            arguments += [facts] * _scalars(slot.type)
        points.append(plan._slots(role))
    for name in _SAMPLE:
        arguments.append(Flow(frozenset((name,)), False, frozenset(), int(name == "coords")))
    signature = "".join(f"{name}: {kind}, " for name, kind in parameters)
    rest = f"s, domain_arg, fields, values, ({''.join(f'{one}, ' for one in points)})"
    lines = [
        f"def probe({signature}s: Sample, domain_arg: DomainArg, fields: Fields, "
        "values: Values, out: wp.array(dtype=Real)):"
    ]
    keys = _store_coefficients(plan, lines, rest)
    slots = "".join(f"{name}, " for name, _ in plan.slot_parameters)
    form = f"form({slots}{rest})"
    if plan.test is None and plan.result is not record.scalar:
        raise NotImplementedError
    lines.append(f"    out[{len(keys)}] = {form}")
    function = function_of_text("\n".join(lines) + "\n", plan.names, __name__)
    kernel = wp.kernel(function, enable_backward=False)
    return kernel.ir("thread", device="cpu"), arguments, keys


def _store_coefficients(plan, lines, rest) -> list:
    """Adds stores of all coefficients; gives their keys."""
    keys: list = []
    test, trial = plan.test, plan.trial
    if test is None or not test.used_slots:
        return keys
    test_slots = "".join(f"{test.role}_{n}, " for n, _ in test.used_slots)
    if trial is None:
        count = len(test.used_slots)
        lines.append(f"    found = gradient_by(form, {count})({test_slots}{rest})")
        for place, (number, slot) in enumerate(test.used_slots):
            for subscript in components(slot.type):
                lines.append(f"    out[{len(keys)}] = found[{place}]{subscript}")
                keys.append((number, subscript))
        return keys
    trial_slots = "".join(f"{trial.role}_{n}, " for n, _ in trial.used_slots)
    for number, _, subscript, name in plan.rows():
        lines.append(
            f"    {name}_found = gradient_by({name}, {len(trial.used_slots)})"
            f"({trial_slots}{test_slots}{rest})"
        )
        for place, (other, other_slot) in enumerate(trial.used_slots):
            for column in components(other_slot.type):
                lines.append(f"    out[{len(keys)}] = {name}_found[{place}]{column}")
                keys.append((number, subscript, other, column))
    return keys
