"""Element vectors and matrices - texts of kernels of the plan by points."""

from __future__ import annotations

from warp import extend
from warp._src.fem.forms.terms import MOST_LOCAL, components, dof_count, fits_thread

# Numbers of a thread for coefficients at all points.
_MOST_KEPT = 4096

# Products of nodes and points from which sums over points are made node by node.
_FEW_TERMS = 100


def stored_vector_text(plan) -> str | None:
    """Text of the kernel of element vectors whose coefficients at all points are kept in memory of
    the thread, so that sums over points stay in registers; None if it does not apply."""
    test, names, count = plan.test, plan.names, plan.record.quadrature.points
    if count is None or test.halves != 1 or not test.basis(plan.record.rule).is_tabulated:
        return None
    used, nodes = test.used_slots, test.nodes.node_count
    if not used or count * len(used) > MOST_LOCAL or nodes * count < _FEW_TERMS:
        return None
    if not all(fits_thread(count, slot.type) for _, slot in used):
        return None
    terms = plan.terms(test)
    names |= {"test_value": terms.value, "test_gradient": terms.gradient}
    names["Block"] = plan.block_dtype
    lines = [
        f"def vector(first: int, {plan.COMMON}, blocks: wp.array(dtype=Block)):",
        "    local = wp.tid()",
        "    domain_element = first + local",
    ]
    by_lines = plan.lines_of("test")
    if by_lines is not None:
        lines += by_lines.memory_lines()
        plan._loop(lines)
        _coefficients(plan, test, lines)
        by_lines.store(lines)
        by_lines.after_points(lines)
        return "\n".join(lines) + "\n"
    for number, slot in used:
        names[f"Slot_test_{number}"] = slot.type
        lines.append(f"    kept_{number} = wp.zeros(shape=({count},), dtype=Slot_test_{number})")
    plan._loop(lines)
    _coefficients(plan, test, lines)
    for number, _ in used:
        lines.append(f"        kept_{number}[q] = c_{number}")
    terms = []
    for number, slot in used:
        word = "gradient" if slot.is_gradient else "value"
        basis = plan._basis_call(test, slot, "q", "i").replace("geo, s, ", "geo, first_s, ")
        terms.append(f"test_{word}({basis}, kept_{number}[q])")
    lines += [
        f"    for i in range({nodes}):",
        "        total = Block()",
        f"        for q in range({count}):",
        f"            total += {' + '.join(terms)}",
        f"        blocks[local * {nodes} + i] = total",
    ]
    return "\n".join(lines) + "\n"


def linear_text(plan) -> str:
    """Text of the kernel of element vectors."""
    stored = stored_vector_text(plan)
    if stored is not None:
        return stored
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
    # Larger vectors, as larger matrices, are summed in the array of blocks, not in the thread.
    width, is_local = count * test.halves, fits_thread(count, plan.block_dtype)
    if is_local:
        memory = "sum_{}[i]"
        lines += [
            f"    sum_{half} = wp.zeros(shape=({count},), dtype=Block)"
            for half in range(test.halves)
        ]
    else:
        memory = f"blocks[local * {width} + {{}} * {count} + i]"
        lines += [f"    for i in range({width}):", f"        blocks[local * {width} + i] = Block()"]
    plan._loop(lines)
    _coefficients(plan, test, lines)
    for half in range(test.halves):
        used = [(i, s) for i, s in test.used_slots if s.half == half]
        if used:
            lines.append(f"        for i in range({count}):")
            terms = _sum(plan, test, used, "c", "i")
            lines.append(f"            {memory.format(half)} += {terms}")
    for half in range(test.halves if is_local else 0):
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


def split(role, slot, subscript) -> tuple:
    """Component of the degree of freedom, and of the basis function, of a component of a slot."""
    if role.nodes.values.map != "identity":
        return 0, subscript
    places = subscript.strip("[]").split(", ")
    if extend.type_is_matrix(role.nodes.dof_dtype) and not slot.is_gradient:
        return int(places[0]) * role.nodes.dof_dtype._shape_[1] + int(places[1]), ""
    if dof_count(role.nodes.dof_dtype) > 1 or extend.type_is_vector(role.nodes.dof_dtype):
        return int(places[0]), f"[{places[1]}]" if slot.is_gradient else ""
    return 0, subscript


def stored_text(plan) -> str | None:
    """Text of the kernel of element matrices whose coefficients at all points are kept in memory
    of the thread, so that sums over points stay in registers; None if it does not apply."""
    test, trial = plan.test, plan.trial
    count, rows, columns = (
        plan.record.quadrature.points,
        *(role.nodes.node_count for role in (test, trial)),
    )
    if count is None or test.halves != 1 or plan.structure.coefficients is None:
        return None
    if not all(role.basis(plan.record.rule).is_tabulated for role in (test, trial)):
        return None
    found = {k: one for k, one in plan.structure.coefficients.items() if not one.is_zero}
    kept = len({one.number for one in found.values()})
    groups = {split_row(plan, key) for key in found}
    if (kept + len(groups)) * count > _MOST_KEPT or count > MOST_LOCAL or not found:
        return None
    lines, pairs = kept_coefficients(plan, count)
    for one in pairs:
        one.text = f"kept_{one.text}[q]"
    lines.append(f"    for j in range({columns}):")
    lines.append(f"        for q in range({count}):")
    sums = _columns(plan, pairs, lines)
    for place, text in enumerate(sums.values()):
        lines.insert(3, f"    rows_{place} = wp.zeros(shape=({count},), dtype=Real)")
        lines.append(f"            rows_{place}[q] = {text}")
    lines.append(f"        for i in range({'j + 1' if plan.is_symmetric else rows}):")
    lines.append("            block = Block()")
    lines.append(f"            for q in range({count}):")
    for number in sorted({key[0] for key in sums}):
        call = plan._basis_call(test, test.slots[number], "q", "i")
        lines.append(f"                a_{number} = {call}")
    entries: dict = {}
    for place, (number, basis, row, column) in enumerate(sums):
        text = f"a_{number}{basis} * rows_{place}[q]"
        entries.setdefault((row, column), []).append(text)
    block = block_text(plan, {key: " + ".join(terms) for key, terms in entries.items()})
    lines.append(f"                block += {block}")
    store_block(plan, lines, "            ", f"local * {rows * columns}", columns)
    end = lines.index(f"    for j in range({columns}):")
    lines[end:] = [
        line.replace("domain_arg.geo, s, ", "domain_arg.geo, first_s, ") for line in lines[end:]
    ]
    return "\n".join(lines) + "\n"


def kept_coefficients(plan, count) -> tuple:
    """First lines of a kernel of element matrices, whose arrays `kept_...` have the coefficients at
    all points, and the coefficients."""
    plan.names["Block"] = plan.block_dtype
    lines = [
        f"def matrix(first: int, {plan.COMMON}, blocks: wp.array(dtype=Block)):",
        "    local = wp.tid()",
        "    domain_element = first + local",
    ]
    plan._loop(lines)
    pairs = add_coefficients(plan, lines, "        ")
    for text in dict.fromkeys(one.text for one in pairs):
        lines.insert(3, f"    kept_{text} = wp.zeros(shape=({count},), dtype=Real)")
        lines.append(f"        kept_{text}[q] = {text}")
    return lines, pairs


def split_row(plan, key) -> tuple:
    """The row of a coefficient among products with basis functions of the trial function."""
    row_dof, row_basis = split(plan.test, plan.test.slots[key[0]], key[1])
    column_dof, _ = split(plan.trial, plan.trial.slots[key[2]], key[3])
    return key[0], row_basis, row_dof, column_dof


def bilinear_text(plan) -> str:
    """Text of the kernel of element matrices."""
    stored = stored_text(plan)
    if stored is not None:
        return stored
    test, trial, names = plan.test, plan.trial, plan.names
    names["Block"] = plan.block_dtype
    rows, columns = test.nodes.node_count, trial.nodes.node_count
    height, width = rows * test.halves, columns * trial.halves
    size = height * width * dof_count(test.nodes.dof_dtype) * dof_count(trial.nodes.dof_dtype)
    is_local = size <= MOST_LOCAL
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
    pairs = add_coefficients(plan, lines, "        ")
    for half in range(trial.halves):
        mine = [one for one in pairs if one.column.half == half]
        if mine:
            lines.append(f"        for j in range({columns}):")
            sums = _columns(plan, mine, lines)
            for other in range(test.halves):
                _entries(plan, sums, other, half, is_local, lines)
    if is_local:
        lines.append(f"    for i in range({height * width}):")
        lines.append("        blocks[base + i] = sums[i]")
    return "\n".join(lines) + "\n"


class Pair:
    """A coefficient that is not zero: of a component of a slot of the test function and one of the
    trial function.

    Attributes:
        row, column: slots. row_number, column_number: their numbers. row_basis, column_basis:
            subscripts of basis functions. row_dof, column_dof: components of the block.
        text: the coefficient.
    """

    def __init__(self, plan, key, text):
        self.row_number, row_subscript, self.column_number, column_subscript = key
        self.row = plan.test.slots[self.row_number]
        self.column = plan.trial.slots[self.column_number]
        self.row_dof, self.row_basis = split(plan.test, self.row, row_subscript)
        self.column_dof, self.column_basis = split(plan.trial, self.column, column_subscript)
        self.text = text


def add_coefficients(plan, lines, indent) -> list[Pair]:
    """Adds the coefficients of the form at a point, scaled; gives those that are not zero."""
    trial, pairs, known = plan.trial, [], {}
    facts = plan.structure.coefficients or {}
    for number, _, subscript, name in plan.rows():
        keys = [
            (number, subscript, other, column)
            for other, slot in trial.used_slots
            for column in components(slot.type)
        ]
        keys = [key for key in keys if not plan.structure.is_zero(*key)]
        fresh = [key for key in keys if key not in facts or facts[key].number not in known]
        if fresh:
            lines.append(
                f"{indent}{name}_found = gradient_by({name}, {len(trial.used_slots)})"
                f"({plan._zeros(trial)}{plan._zeros(plan.test)}{plan.REST})"
            )
        places = {other: place for place, (other, _) in enumerate(trial.used_slots)}
        for key in keys:
            # Coefficients that are equal for all arguments are worked out once.
            number = facts[key].number if key in facts else key
            if number not in known:
                known[number] = f"d_{len(pairs)}"
                source = f"{name}_found[{places[key[2]]}]{key[3]}"
                lines.append(f"{indent}{known[number]} = scale * {source}")
            pairs.append(Pair(plan, key, known[number]))
    return pairs


def _columns(plan, pairs, lines) -> dict:
    """Adds the products with the basis functions of node j: a number for each component of a slot
    of the test function and of the block's columns."""
    indent = "            "
    for number in sorted({one.column_number for one in pairs}):
        slot = plan.trial.slots[number]
        lines.append(f"{indent}b_{number} = {plan._basis_call(plan.trial, slot, 'q', 'j')}")
    groups: dict = {}
    for one in pairs:
        key = one.row_number, one.row_basis, one.row_dof, one.column_dof
        groups.setdefault(key, []).append(one)
    for place, (key, ones) in enumerate(groups.items()):
        terms = [f"{one.text} * b_{one.column_number}{one.column_basis}" for one in ones]
        lines.append(f"{indent}r_{place} = {' + '.join(terms)}")
        groups[key] = f"r_{place}"
    return groups


def block_text(plan, entries) -> str:
    """A block from the texts of its entries, by row and column."""
    rows, columns = plan.test.nodes.dof_dtype, plan.trial.nodes.dof_dtype
    if plan.block_dtype is plan.record.scalar:
        return entries[0, 0]
    texts = [
        entries.get((i, j), "Real(0.0)")
        for i in range(dof_count(rows))
        for j in range(dof_count(columns))
    ]
    return f"Block({', '.join(texts)})"


def store_block(plan, lines, indent, base, columns):
    """Adds the stores of `block` of nodes i and j; of symmetric forms, to both of its places."""
    is_scalar = plan.block_dtype is plan.record.scalar
    if plan.is_symmetric:
        if not is_scalar:
            lines.append(f"{indent}other = wp.transpose(block)")
            lines.append(f"{indent}if i == j:")
            lines.append(f"{indent}    block = Real(0.5) * (block + other)")
            lines.append(f"{indent}    other = block")
        turned = "block" if is_scalar else "other"
        lines.append(f"{indent}blocks[{base} + j * {columns} + i] = {turned}")
    lines.append(f"{indent}blocks[{base} + i * {columns} + j] = block")


def _entries(plan, groups, test_half, trial_half, is_local, lines):
    """Adds the entries of column j of one pair of halves."""
    test, trial = plan.test, plan.trial
    rows, columns = test.nodes.node_count, trial.nodes.node_count
    width, indent = columns * trial.halves, "                "
    mine = {key: text for key, text in groups.items() if test.slots[key[0]].half == test_half}
    if not mine:
        return
    lines.append(f"            for i in range({rows}):")
    for number in sorted({key[0] for key in mine}):
        call = plan._basis_call(test, test.slots[number], "q", "i")
        lines.append(f"{indent}a_{number} = {call}")
    entries: dict = {}
    for (number, basis, row, column), text in mine.items():
        entries.setdefault((row, column), []).append(f"a_{number}{basis} * {text}")
    block = block_text(plan, {key: " + ".join(terms) for key, terms in entries.items()})
    target = f"({test_half * rows} + i) * {width} + {trial_half * columns} + j"
    memory = f"sums[{target}]" if is_local else f"blocks[base + {target}]"
    lines.append(f"{indent}{memory} += {block}")
