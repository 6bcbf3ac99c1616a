"""Element vectors and matrices - texts of kernels of the plan by points."""

from __future__ import annotations

from warp import extend
from warp._src.fem.forms.terms import components, dof_count

# Larger element matrices are summed in the memory of the blocks, not of the thread.
_MOST_LOCAL = 1024


def linear_text(plan) -> str:
    """Text of the kernel of element vectors."""
    test, names = plan.test, plan.names
    terms = plan.terms(test)
    names |= {"test_value": terms.value, "test_gradient": terms.gradient}
    names["Block"] = plan.block_dtype
    count = test.nodes.node_count
    lines = [
        f"def vector(first: int, {plan.COMMON}, blocks: wp.array(dtype=Block)):",
        "    local = wp.tid()",
        "    domain_element = first + local",
    ]
    for half in range(test.halves):
        lines.append(f"    sum_{half} = wp.zeros(shape=({count},), dtype=Block)")
    plan._loop(lines)
    _coefficients(plan, test, lines)
    for half in range(test.halves):
        used = [(i, s) for i, s in test.used_slots if s.half == half]
        if used:
            lines.append(f"        for i in range({count}):")
            lines.append(f"            sum_{half}[i] += {_sum(plan, test, used, 'c', 'i')}")
    width = count * test.halves
    for half in range(test.halves):
        lines.append(f"    for i in range({count}):")
        lines.append(f"        blocks[local * {width} + {half * count} + i] = sum_{half}[i]")
    return "\n".join(lines) + "\n"


def _coefficients(plan, role, lines):
    """Adds the coefficients of the slots of the test function, scaled."""
    used = role.used_slots
    if not used:
        return
    lines.append(f"        found = gradient_by(form, {len(used)})({plan._zeros(role)}{plan.REST})")
    for place, (number, _) in enumerate(used):
        lines.append(f"        c_{number} = scale * found[{place}]")


def _sum(plan, role, used, prefix, node) -> str:
    """The sum of the products of slots' coefficients with basis functions of a node."""
    parts = []
    for number, slot in used:
        word = "gradient" if slot.is_gradient else "value"
        basis = plan._basis_call(role, slot, "q", node)
        parts.append(f"{role.role}_{word}({basis}, {prefix}_{number})")
    return " + ".join(parts)


def bilinear_text(plan) -> str:
    """Text of the kernel of element matrices."""
    test, trial, names = plan.test, plan.trial, plan.names
    terms = plan.terms(trial)
    names |= {"trial_value": terms.value, "trial_gradient": terms.gradient}
    names["Block"] = plan.block_dtype
    rows, columns = test.nodes.node_count, trial.nodes.node_count
    height, width = rows * test.halves, columns * trial.halves
    size = height * width * dof_count(test.nodes.dof_dtype) * dof_count(trial.nodes.dof_dtype)
    is_local = size <= _MOST_LOCAL
    lines = [
        f"def matrix(first: int, {plan.COMMON}, blocks: wp.array(dtype=Block)):",
        "    local = wp.tid()",
        "    domain_element = first + local",
        f"    base = local * {height * width}",
    ]
    if is_local:
        lines.append(f"    sums = wp.zeros(shape=({height * width},), dtype=Block)")
    else:
        lines += [f"    for i in range({height * width}):", "        blocks[base + i] = Block()"]
    plan._loop(lines)
    parts = _rows(plan, test, trial, lines)
    for half in range(trial.halves):
        used = [(i, s) for i, s in trial.used_slots if s.half == half]
        if used and parts:
            lines.append(f"        for j in range({columns}):")
            _columns(plan, used, parts, lines)
            for other in range(test.halves):
                _entries(plan, parts, other, half, is_local, lines)
    if is_local:
        lines.append(f"    for i in range({height * width}):")
        lines.append("        blocks[base + i] = sums[i]")
    return "\n".join(lines) + "\n"


def _rows(plan, test, trial, lines) -> list:
    """Adds, for each component of each slot of the test function, the coefficients of the trial
    function's slots. Gives (slot of the test function, subscript, prefix)."""
    made = []
    test_slots = "".join(f"{name}, " for name, _ in plan.slot_parameters[: len(test.used_slots)])
    trial_slots = "".join(f"{name}, " for name, _ in plan.slot_parameters[len(test.used_slots) :])
    typed = [*plan.slot_parameters[len(test.used_slots) :]]
    typed += plan.slot_parameters[: len(test.used_slots)]
    parameters = "".join(f"{name}: {kind}, " for name, kind in typed)
    if not trial.used_slots:
        return made
    for place, (number, slot) in enumerate(test.used_slots):
        for index, subscript in enumerate(components(slot.type)):
            name = f"row_{number}_{index}"
            plan.names[name] = plan._function(
                f"def {name}({parameters}s: Sample, domain_arg: DomainArg, fields: Fields, "
                f"values: Values, points: Any):\n"
                f"    found = gradient_by(form, {len(test.used_slots)})"
                f"({test_slots}{trial_slots}{plan.REST})\n"
                f"    return found[{place}]{subscript}\n"
            )
            lines.append(
                f"        d_{number}_{index} = gradient_by({name}, {len(trial.used_slots)})"
                f"({plan._zeros(trial)}{plan._zeros(test)}{plan.REST})"
            )
            for at, (other, _) in enumerate(trial.used_slots):
                lines.append(
                    f"        d_{number}_{index}_{other} = scale * d_{number}_{index}[{at}]"
                )
            made.append((number, slot, subscript, f"d_{number}_{index}"))
    return made


def _columns(plan, used, parts, lines):
    """Adds the products with the basis functions of node j."""
    for number, slot in used:
        word = "gradient" if slot.is_gradient else "value"
        call = plan._basis_call(plan.trial, slot, "q", "j")
        lines.append(f"            b_{number} = {call}")
        plan.names[f"trial_{word}"] = getattr(plan.terms(plan.trial), word)
    for _, _, _, prefix in parts:
        terms = [
            f"trial_{'gradient' if slot.is_gradient else 'value'}(b_{number}, {prefix}_{number})"
            for number, slot in used
        ]
        lines.append(f"            {prefix}_j = {' + '.join(terms)}")


def _entries(plan, parts, test_half, trial_half, is_local, lines):
    """Adds the entries of column j of one pair of halves."""
    test, trial = plan.test, plan.trial
    rows, columns = test.nodes.node_count, trial.nodes.node_count
    width = columns * trial.halves
    mine = [one for one in parts if one[1].half == test_half]
    if not mine:
        return
    lines.append(f"            for i in range({rows}):")
    slots = {number: slot for number, slot, _, _ in mine}
    for number, slot in slots.items():
        lines.append(f"                a_{number} = {plan._basis_call(test, slot, 'q', 'i')}")
    entry = _entry(plan, mine)
    target = f"({test_half * rows} + i) * {width} + {trial_half * columns} + j"
    memory = f"sums[{target}]" if is_local else f"blocks[base + {target}]"
    lines.append(f"                {memory} += {entry}")


def _entry(plan, mine) -> str:
    """The block of nodes i and j as an expression."""
    test, trial = plan.test.nodes, plan.trial.nodes
    is_scalar = plan.block_dtype is plan.record.scalar
    if test.values.map != "identity" or not extend.type_is_vector(test.dof_dtype):
        # Each component of a slot goes with the same component of the basis function.
        row = " + ".join(
            f"a_{number}{subscript} * {prefix}_j" for number, _, subscript, prefix in mine
        )
        if is_scalar:
            return row
        return f"wp.matrix_from_rows({row})"
    found = []
    for n in range(dof_count(test.dof_dtype)):
        terms = []
        for number, slot, subscript, prefix in mine:
            place = subscript.strip("[]").split(", ")
            if int(place[0]) == n:
                basis = f"a_{number}[{place[1]}]" if slot.is_gradient else f"a_{number}"
                terms.append(f"{basis} * {prefix}_j")
        found.append(" + ".join(terms))
    if extend.type_is_vector(trial.dof_dtype):
        return f"wp.matrix_from_rows({', '.join(found)})"
    return f"Block({', '.join(found)})"
