"""Element vectors and matrices - texts of kernels of the plan by points."""

from __future__ import annotations

from warp import extend
from warp._src.fem.forms.terms import (
    MOST_LOCAL,
    components,
    dof_count,
    fits_thread,
    term_functions,
)

# Numbers of a thread for coefficients at all points.
MOST_KEPT = 4096

# Products of nodes and points from which sums over points are made node by node.
_FEW_TERMS = 100

# Names in texts: of basis functions, and of the node.
_BASIS, _NODE = {"test": "a", "trial": "b"}, {"test": "i", "trial": "j"}


def head(plan, name: str, more: str = "") -> list:
    """First lines of a kernel of element vectors or matrices."""
    plan.names["Block"] = plan.block_dtype
    return [
        f"def {name}(first: int, {plan.COMMON}{more}, blocks: wp.array(dtype=Block)):",
        "    local = wp.tid()",
        "    domain_element = first + local",
    ]


def joined(lines) -> str:
    """Text of lines."""
    return "\n".join(lines) + "\n"


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
    lines = head(plan, "vector")
    by_lines = plan.lines_of("test")
    if by_lines is not None:
        lines += by_lines.memory_lines()
        plan._loop(lines)
        _coefficients(plan, test, lines)
        by_lines.store(lines)
        by_lines.after_points(lines)
        return joined(lines)
    for number, slot in used:
        names[f"Slot_test_{number}"] = slot.type
        lines.append(f"    kept_{number} = wp.zeros(shape=({count},), dtype=Slot_test_{number})")
    plan._loop(lines)
    _coefficients(plan, test, lines)
    for number, _ in used:
        lines.append(f"        kept_{number}[q] = c_{number}")
    lines += [
        f"    for i in range({nodes}):",
        "        total = Block()",
        f"        for q in range({count}):",
        f"            total += {_sum(plan, test, used, 'kept_{}[q]', 'first_s')}",
        f"        blocks[local * {nodes} + i] = total",
    ]
    return joined(lines)


def linear_text(plan) -> str:
    """Text of the kernel of element vectors."""
    test = plan.test
    terms = term_functions(test.nodes.values)
    plan.names |= {"test_value": terms.value, "test_gradient": terms.gradient}
    stored = stored_vector_text(plan)
    if stored is not None:
        return stored
    count, lines = test.nodes.node_count, head(plan, "vector")
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
            lines.append(f"            {memory.format(half)} += {_sum(plan, test, used, 'c_{}')}")
    for half in range(test.halves if is_local else 0):
        lines.append(f"    for i in range({count}):")
        lines.append(f"        blocks[local * {width} + {half * count} + i] = sum_{half}[i]")
    return joined(lines)


def _coefficients(plan, role, lines):
    """Adds the coefficients of the slots of the test function, scaled."""
    used = role.used_slots
    if not used:
        return
    lines.append(f"        found = gradient_by(form, {len(used)})({plan._zeros(role)}{plan.REST})")
    for place, (number, _) in enumerate(used):
        lines.append(f"        c_{number} = scale * found[{place}]")


def _sum(plan, role, used, name, sample="s") -> str:
    """The sum of the products of slots' coefficients with basis functions of node i."""
    parts = []
    for number, slot in used:
        word = "gradient" if slot.is_gradient else "value"
        basis = plan._basis_call(role, slot, "q", "i", sample)
        parts.append(f"{role.role}_{word}({basis}, {name.format(number)})")
    return " + ".join(parts)


def _split(role, slot, subscript) -> tuple:
    """Component of the degree of freedom, and of the basis function, of a component of a slot."""
    if role.nodes.values.map != "identity":
        return 0, subscript
    places = subscript.strip("[]").split(", ")
    if extend.type_is_matrix(role.nodes.dof_dtype) and not slot.is_gradient:
        return int(places[0]) * role.nodes.dof_dtype._shape_[1] + int(places[1]), ""
    if dof_count(role.nodes.dof_dtype) > 1 or extend.type_is_vector(role.nodes.dof_dtype):
        return int(places[0]), f"[{places[1]}]" if slot.is_gradient else ""
    return 0, subscript


class Pair:
    """A coefficient that is not zero: of a component of a slot of the test function and one of the
    trial function.

    Attributes:
        ends: by role: number of the slot, and subscript of its basis functions.
        block: row and column of the block. text: the coefficient.
    """

    def __init__(self, plan, key, text):
        self.text, self.ends, block = text, {}, []
        for role, number, subscript in ((plan.test, *key[:2]), (plan.trial, *key[2:])):
            dof, basis = _split(role, role.slots[number], subscript)
            self.ends[role.role] = number, basis
            block.append(dof)
        self.block = tuple(block)

    def is_gradient(self, role) -> bool:
        """True if the slot of a role is a gradient."""
        return role.slots[self.ends[role.role][0]].is_gradient


def stored_text(plan) -> str | None:
    """Text of the kernel of element matrices whose coefficients at all points are kept in memory
    of the thread, so that sums over points stay in registers; None if it does not apply."""
    test, trial, count = plan.test, plan.trial, plan.record.quadrature.points
    rows, columns = (role.nodes.node_count for role in (test, trial))
    if count is None or test.halves != 1 or plan.structure.coefficients is None:
        return None
    if not all(role.basis(plan.record.rule).is_tabulated for role in (test, trial)):
        return None
    found = {k: one for k, one in plan.structure.coefficients.items() if not one.is_zero}
    kept = len({one.number for one in found.values()})
    pairs = [Pair(plan, key, "") for key in found]
    groups = {(one.ends["test"], one.block) for one in pairs}
    if (kept + len(groups)) * count > MOST_KEPT or count > MOST_LOCAL or not found:
        return None
    lines, pairs = kept_coefficients(plan, count)
    for one in pairs:
        one.text = f"kept_{one.text}[q]"
    lines.append(f"    for j in range({columns}):")
    lines.append(f"        for q in range({count}):")
    sums = contracted(plan, pairs, trial, lines, "            ", "first_s")
    for place, (key, text) in enumerate(sums.items()):
        lines.insert(3, f"    rows_{place} = wp.zeros(shape=({count},), dtype=Real)")
        lines.append(f"            rows_{place}[q] = {text}")
        sums[key] = f"rows_{place}[q]"
    lines.append(f"        for i in range({'j + 1' if plan.is_symmetric else rows}):")
    lines.append("            block = Block()")
    lines.append(f"            for q in range({count}):")
    block = entries(plan, sums, test, lines, "                ", "first_s")
    lines.append(f"                block += {block}")
    store_block(plan, lines, "            ", f"local * {rows * columns}", columns)
    return joined(lines)


def kept_coefficients(plan, count) -> tuple:
    """First lines of a kernel of element matrices, whose arrays `kept_...` have the coefficients at
    all points, and the coefficients."""
    lines = head(plan, "matrix")
    plan._loop(lines)
    pairs = add_coefficients(plan, lines, "        ")
    for text in dict.fromkeys(one.text for one in pairs):
        lines.insert(3, f"    kept_{text} = wp.zeros(shape=({count},), dtype=Real)")
        lines.append(f"        kept_{text}[q] = {text}")
    return lines, pairs


def bilinear_text(plan) -> str:
    """Text of the kernel of element matrices."""
    stored = stored_text(plan)
    if stored is not None:
        return stored
    test, trial = plan.test, plan.trial
    rows, columns = test.nodes.node_count, trial.nodes.node_count
    height, width = rows * test.halves, columns * trial.halves
    size = height * width * dof_count(test.nodes.dof_dtype) * dof_count(trial.nodes.dof_dtype)
    is_local = size <= MOST_LOCAL
    lines = [*head(plan, "matrix"), f"    base = local * {height * width}"]
    if is_local:
        lines.append(f"    sums = wp.zeros(shape=({height * width},), dtype=Block)")
    else:
        lines += [f"    for i in range({height * width}):", "        blocks[base + i] = Block()"]
    plan._loop(lines)
    pairs = add_coefficients(plan, lines, "        ")
    for half in range(trial.halves):
        mine = [one for one in pairs if trial.slots[one.ends["trial"][0]].half == half]
        if not mine:
            continue
        lines.append(f"        for j in range({columns}):")
        sums = contracted(plan, mine, trial, lines, "            ")
        for other in range(test.halves):
            of_half = {k: text for k, text in sums.items() if test.slots[k[0]].half == other}
            if of_half:
                lines.append(f"            for i in range({rows}):")
                block = entries(plan, of_half, test, lines, "                ")
                target = f"({other * rows} + i) * {width} + {half * columns} + j"
                memory = f"sums[{target}]" if is_local else f"blocks[base + {target}]"
                lines.append(f"                {memory} += {block}")
    if is_local:
        lines.append(f"    for i in range({height * width}):")
        lines.append("        blocks[base + i] = sums[i]")
    return joined(lines)


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


def _bases(plan, role, numbers, lines, indent, sample):
    """Adds basis functions of the node of a role, for slots of these numbers."""
    name, node = _BASIS[role.role], _NODE[role.role]
    for number in sorted(set(numbers)):
        call = plan._basis_call(role, role.slots[number], "q", node, sample)
        lines.append(f"{indent}{name}_{number} = {call}")


def contracted(plan, pairs, role, lines, indent, sample="s") -> dict:
    """Adds the products of coefficients with the basis functions of a role's node; gives their
    names by the slot of the other role, the subscript of its basis, and the entry of the block."""
    other = "test" if role.role == "trial" else "trial"
    _bases(plan, role, (one.ends[role.role][0] for one in pairs), lines, indent, sample)
    groups: dict = {}
    for one in pairs:
        number, basis = one.ends[role.role]
        term = f"{one.text} * {_BASIS[role.role]}_{number}{basis}"
        groups.setdefault((*one.ends[other], one.block), []).append(term)
    for place, (key, terms) in enumerate(groups.items()):
        lines.append(f"{indent}r_{place} = {' + '.join(terms)}")
        groups[key] = f"r_{place}"
    return groups


def entries(plan, sums, role, lines, indent, sample="s") -> str:
    """Adds the basis functions of a role's node; gives the block of the products with `sums`, which
    `contracted` gave for the other role."""
    _bases(plan, role, (number for number, _, _ in sums), lines, indent, sample)
    name = _BASIS[role.role]
    return block_text(plan, ((b, f"{name}_{n}{basis} * {t}") for (n, basis, b), t in sums.items()))


def block_text(plan, terms) -> str:
    """A block from the texts of terms of its entries: pairs of (row, column) and the text."""
    texts: dict = {}
    for place, text in terms:
        texts.setdefault(place, []).append(text)
    if not texts:
        return "Block()"
    rows, columns = (dof_count(role.nodes.dof_dtype) for role in (plan.test, plan.trial))
    zero = ["Real(0.0)"]
    made = [" + ".join(texts.get((i, j), zero)) for i in range(rows) for j in range(columns)]
    return made[0] if plan.block_dtype is plan.record.scalar else f"Block({', '.join(made)})"


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
