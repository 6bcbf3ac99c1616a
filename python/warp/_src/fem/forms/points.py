"""Plan by points - the integrand's coefficients of slots at each point, then tables of bases.

A thread has an element. At each point, the form is a function of the slots of its fields: values
and gradients in reference coordinates. Its derivatives by the slots of the test function (and of
the trial function) are its coefficients; the element's vector (matrix) is their product with basis
functions. Structure is exact: what does not depend on a slot has no code.
"""

from __future__ import annotations

import dataclasses
import functools

import warp as wp
from warp import extend
from warp._src.fem.assembly.gather import with_scalar
from warp._src.fem.fields.base import MARK
from warp._src.fem.fields.nodes import (
    dof_function,
    gradient_product_function,
    locations,
    scaled,
)
from warp._src.fem.forms import facts
from warp._src.fem.forms.basis import table_type, table_value
from warp._src.fem.forms.descriptions import DomainDescription
from warp._src.fem.forms.flow import UNKNOWN
from warp._src.fem.forms.slots import NODE_OPERATORS, Role
from warp._src.fem.forms.terms import (
    components,
    dof_count,
    fits_thread,
)
from warp._src.fem.kept import function_of_text
from warp._src.fem.types import sample_type


class NodeOperatorsError(Exception):
    """The form applies operators of nodes to its test or trial function."""


def _parameters(names_types) -> str:
    return "".join(f"{name}: {kind}, " for name, kind in names_types)


class PointsPlan:
    """Kernels of a form.

    Attributes:
        record: of the form. roles: fields with slots, by name; test and trial among them.
        result: type of the integrand.
    """

    has_slots = True

    @classmethod
    @functools.cache
    def of(cls, record, *more):
        """The plan of a form's record."""
        return cls(record, *more)

    def __init__(self, record):
        self.record = record
        self.tensors, self._on_device = None, {}
        self.domain = record.domain.functions
        real = record.scalar
        words = facts.words_of(record.integrand)
        self.moves = facts.may_move(words)
        self.looks_up = not {"lookup", "partition_lookup"}.isdisjoint(words)
        self.names: dict = {
            "wp": wp,
            "extend": extend,
            "Real": real,
            "Sample": sample_type(real),
            "DomainArg": self.domain.DomainArg,
            "DOMAIN": DomainDescription(record.domain),
            "INTEGRAND": getattr(record.integrand, "root", record.integrand),
            "gradient_by": extend.gradient_by,
            "measure": self.domain.element_measure,
            "element_index": self.domain.element_index,
        }
        # Texts of degrees of freedom of node k, by name and half.
        self.reads: dict = {}
        self._add_arguments()
        self.test = self._role("test", record.test)
        self.trial = self._role("trial", record.trial)
        self.discrete = {
            name: Role(name, f"field_{name}", field.nodes, record.domain)
            for name, field, _ in record.fields
            if self.has_slots and hasattr(field, "nodes")
        }
        if hasattr(record.integrand, "steps"):
            from warp._src.fem.forms.variation import check_directions

            check_directions(self)
        self._discover()
        self._add_tables()

    def _role(self, role, named):
        if named is None:
            return None
        return Role(named[0], role, named[1], self.record.domain)

    def _add_arguments(self):
        """Structs of the arguments of fields and of values."""
        record = self.record
        kinds = {name: kind for name, _, kind in record.fields}
        for role, named in (("test_", record.test), ("trial_", record.trial)):
            if named is not None:
                from warp._src.fem.fields.spaces import node_arg_type

                kinds[role] = node_arg_type(named[1])
        self.Fields = _struct("FieldArgs", tuple(kinds.items()))
        self.Values = _struct("ValueArgs", record.values)
        quadrature = record.quadrature
        self.names |= {"Fields": self.Fields, "Values": self.Values, "QuadratureArg": wp.int32}
        if quadrature is not None:
            functions = quadrature.functions
            self.names["QuadratureArg"] = functions.Arg
            for name in ("point_count", "point_coords", "point_weight", "point_index"):
                self.names[name] = getattr(functions, name)

    # The form as a function of slots.

    def _slot_names(self, role) -> list:
        """(parameter, type name) of the slots of a role that the form depends on."""
        found = []
        for number, slot in role.used_slots:
            self.names[f"Slot_{role.role}_{number}"] = slot.type
            found.append((f"{role.role}_{number}", f"Slot_{role.role}_{number}"))
        return found

    def _slots(self, role) -> str:
        """All slots of a role as a tuple, zeros for those that do not count."""
        used = dict(role.used_slots)
        parts = []
        for number, slot in enumerate(role.slots):
            self.names[f"Slot_{role.role}_{number}"] = slot.type
            name = f"{role.role}_{number}"
            parts.append(name if number in used else f"Slot_{name}()")
        return f"({', '.join(parts)},)"

    def _form_function(self):
        """Makes `form`: the integrand as a function of slots and of the kernel's arguments."""
        record, given = self.record, {}
        varied = {field for field, _ in getattr(record.integrand, "steps", ())}
        point = 0
        for name, field, _ in record.fields:
            role = self.discrete.get(name)
            self.names[f"FIELD_{name}"] = role.description(self.moves) if role else field
            slots = "0"
            if role is not None:
                slots, point = f"points[{point}]", point + 1
                if name in varied:
                    slots = self._slots(role)
            given[name] = f"FIELD_{name}({slots}, fields.{name}, domain_arg.geo)"
        for role in filter(None, (self.test, self.trial)):
            given[role.name] = self._virtual(role)
        given |= {name: f"values.{name}" for name, _ in record.values}
        for name, function in record.functions:
            self.names[f"VALUE_{name}"] = function
            given[name] = f"VALUE_{name}"
        integrand = record.integrand
        given[integrand.sample_name] = "s"
        given[integrand.domain_name] = "DOMAIN(domain_arg)"
        arguments = ", ".join(given[name] for name in integrand.parameter_names)
        slots = [one for role in (self.test, self.trial) if role for one in self._slot_names(role)]
        self.slot_parameters = slots
        self.names["Any"] = _any()
        if varied:
            from warp._src.fem.forms.variation import variation_text

            return self._function(variation_text(self, arguments, _parameters(slots)))
        returns = "return " if facts.returns_value(record.integrand) else ""
        return self._function(
            f"def form({_parameters(slots)}s: Sample, domain_arg: DomainArg, fields: Fields, "
            f"values: Values, points: Any):\n    {returns}INTEGRAND({arguments})\n"
        )

    def _virtual(self, role) -> str:
        """The record of a test or trial function in the text of the form."""
        self.names[f"FIELD_{role.name}"] = role.description(self.moves)
        return f"FIELD_{role.name}({self._slots(role)}, 0, domain_arg.geo)"

    def _function(self, text):
        """A function of kernels from text."""
        return wp.func(function_of_text(text, self.names, __name__))

    def _kernel(self, text):
        known = {k: v for k, v in self.record.options if k in ("enable_backward", "launch_bounds")}
        return wp.kernel(function_of_text(text, self.names, __name__), **known)

    def _discover(self):
        """Finds the slots that the form depends on, and the type of its result."""
        base = self._base
        if base is not None:
            self.result, self.operations = base.result, base.operations
        else:
            self.result, self.operations = self._remembered()
        self.discrete = {
            name: role.with_uses(self.operations.get(role.role, ()))
            for name, role in self.discrete.items()
        }
        for role in ("test", "trial"):
            one = getattr(self, role)
            if one is not None:
                one = one.with_uses(self.operations.get(role, ()))
                # A direction has the slots of the field.
                for field, direction in getattr(self.record.integrand, "steps", ()):
                    if direction == one.name:
                        one = dataclasses.replace(one, used=self.discrete[field].used)
                setattr(self, role, one)
        self.names["form"] = self._form_function()

    @functools.cached_property
    def _base(self):
        """The plan of the form without points, which has the facts that do not depend on them."""
        if self.record.quadrature is None or not self.has_slots:
            return None
        return PointsPlan.of(dataclasses.replace(self.record, quadrature=None, rule=None))

    def _remembered(self) -> tuple:
        """As `_probed`, of another process if the kernel cache has it."""
        found: list = []

        def make():
            result, operations = self._probed()
            found.extend((result, operations))
            return encoded_type(result), {k: sorted(v) for k, v in operations.items()}

        key = "operations", type(self).__name__, self.record
        kind, operations = extend.remembered(key, make, lambda made: made[0] is not None)
        return tuple(found) if found else (decoded_type(kind), operations)

    def _probed(self) -> tuple:
        """Type of the result, and operators that are applied to fields, by role."""
        self.names["form"] = self._form_function()
        returns = facts.returns_value(self.record.integrand)
        slots = self.slot_parameters
        text = (
            f"def probe({_parameters(slots)}s: Sample, domain_arg: DomainArg, fields: Fields, "
            f"values: Values):\n"
            f"    {'result = ' * returns}form({', '.join([*(n for n, _ in slots), 's'])}, "
            f"domain_arg, fields, values, {self.zero_points()})\n"
            f"    {'result = 0' * (not returns)}\n"
        )
        function = function_of_text(text, self.names, __name__)
        with facts.recorded_operations() as operations:
            try:
                result = extend.type_of_local(function, "result")
            except wp.WarpCodegenError:
                for role in ("test", "trial"):
                    if not NODE_OPERATORS.isdisjoint(operations.get(role, ())):
                        raise NodeOperatorsError from None
                raise
        return result if returns else None, operations

    def zero_points(self) -> str:
        """The slots of discrete fields where the form does not depend on them."""
        tuples = []
        for role in self.discrete.values():
            self._slots(role)
            parts = [f"Slot_{role.role}_{number}(), " for number in range(len(role.slots))]
            tuples.append(f"({''.join(parts)}), ")
        return f"({''.join(tuples)})"

    # Tables.

    def _roles(self) -> list:
        return [*self.discrete.values(), *filter(None, (self.test, self.trial))]

    def _add_tables(self):
        """Numbers the bases, and makes the struct of their tables."""
        self.bases: list = []
        for role in self._roles():
            for half in range(role.halves):
                basis = role.basis(self.record.rule, half)
                if basis not in self.bases:
                    self.bases.append(basis)
        self.Tables = _struct(
            "Tables", tuple((f"t{i}", table_type(one)) for i, one in enumerate(self.bases))
        )
        self.names["Tables"] = self.Tables
        for i, basis in enumerate(self.bases):
            self.names[f"value_{i}"] = basis.functions.value
            self.names[f"gradient_{i}"] = basis.functions.gradient

    def table_values(self, device):
        """The argument with the tables."""
        tables = self.Tables()
        for i, basis in enumerate(self.bases):
            setattr(tables, f"t{i}", table_value(basis, device))
        return tables

    def _basis_call(self, role, slot, q, k, sample="s") -> str:
        """A basis function, or its gradient, at point q for node k of a half."""
        number = self.bases.index(role.basis(self.record.rule, slot.half))
        word = "gradient" if slot.is_gradient else "value"
        owner = {"test": "test_", "trial": "trial_"}.get(role.role, role.name)
        args = f"tables.t{number}, fields.{owner}.topology, domain_arg.geo, {sample}, {q}, {k}"
        return f"{word}_{number}({args})"

    # Discrete fields at a point.

    def _gather(self, lines):
        """Reads degrees of freedom of discrete fields into memory of the thread."""
        for name, role in self.discrete.items():
            if not role.used:
                continue
            self.names[f"dof_at_{name}"] = dof_function(role.nodes)
            self.names[f"Dof_{name}"] = role.nodes.dof_dtype
            count = role.nodes.node_count
            for half in sorted({slot.half for _, slot in role.used_slots}):
                at = locations(role.domain, half)
                self.names[f"cell_arg_{half}"], self.names[f"cell_{half}"] = at.cell_arg, at.cell
                memory = f"dofs_{name}_{half}"
                read = (
                    f"dof_at_{name}(fields.{name}, cell_arg_{half}(domain_arg.geo), "
                    f"cell_{half}(domain_arg.geo, first_s), k)"
                )
                self.reads[name, half] = read
                if not fits_thread(count, role.nodes.dof_dtype):
                    continue
                self.reads[name, half] = f"{memory}[k]"
                lines.append(f"    {memory} = wp.zeros(shape=({count},), dtype=Dof_{name})")
                lines.append(f"    for k in range({count}):")
                lines.append(f"        {memory}[k] = {read}")
            if self.lines_of(role.role) is not None:
                self.lines_of(role.role).before_points(lines, f"dofs_{name}_0")

    @functools.cache  # noqa: B019 - plans live as long as the program
    def lines_of(self, word):
        """Contractions axis by axis of a discrete field or of the test function, or None."""
        from warp._src.fem.forms.tensor import lines_of

        roles = {role.role: role for role in self._roles()}
        return lines_of(self, roles[word])

    def _points(self, lines):
        """Sums the slots of discrete fields at the point."""
        tuples = []
        for name, role in self.discrete.items():
            self.names[f"of_value_{name}"] = scaled
            self.names[f"of_gradient_{name}"] = gradient_product_function(role.nodes.values)
            self._slots(role)
            used = dict(role.used_slots)
            if used and self.lines_of(role.role) is not None:
                self.lines_of(role.role).at_point(lines)
                tuples.append(self._slots(role))
                continue
            for number in used:
                lines.append(f"        {role.role}_{number} = Slot_{role.role}_{number}()")
            for half in sorted({slot.half for slot in used.values()}):
                lines.append(f"        for k in range({role.nodes.node_count}):")
                for number, slot in used.items():
                    if slot.half == half:
                        word = "gradient" if slot.is_gradient else "value"
                        basis = self._basis_call(role, slot, "q", "k")
                        lines.append(
                            f"            {role.role}_{number} += of_{word}_{name}({basis}, "
                            f"{self.reads[name, half]})"
                        )
            tuples.append(self._slots(role))
        lines.append(f"        points = ({''.join(f'{one}, ' for one in tuples)})")

    _NO_DOF = "wp.vec2i(-1, -1)"

    @staticmethod
    def sample(q, test=_NO_DOF, trial=_NO_DOF) -> str:
        """The sample at point q of an element, with degrees of freedom."""
        args = f"domain_arg.geo, quadrature, domain_element, element, {q}"
        return (
            f"Sample(element, point_coords({args}), point_index({args}), point_weight({args}), "
            f"{test}, {trial})"
        )

    @property
    def point_count(self):
        """Number of points of an element."""
        count = self.record.quadrature.points
        at = "domain_arg.geo, quadrature, domain_element, element"
        return f"point_count({at})" if count is None else count

    def _loop(self, lines):
        """Element, sample and the loop over points."""
        count, mark = self.point_count, f"wp.vec2i(q, {MARK})"
        lines.append("    element = element_index(domain_arg.index, domain_element)")
        if self.record.domain.has_gaps:
            count = self.skip_gap(lines, "    ", count)
        lines += [
            "    first_s = Sample()",
            "    first_s.element_index = element",
        ]
        self._gather(lines)
        lines += [
            f"    for q in range({count}):",
            f"        s = {self.sample('q', mark, mark)}",
            "        scale = measure(domain_arg.geo, s) * s.qp_weight",
        ]
        self._points(lines)

    @staticmethod
    def skip_gap(lines, indent, count):
        """Number of points of an element that may be missing: 0 then, and it reads the first."""
        lines.append(f"{indent}points_here = wp.where(element < 0, 0, {count})")
        lines.append(f"{indent}element = wp.max(element, 0)")
        return "points_here"

    def first_sample(self, lines):
        """The sample at the first point of the element."""
        mark = f"wp.vec2i(0, {MARK})"
        lines += [
            "    element = wp.max(element_index(domain_arg.index, domain_element), 0)",
            f"    s = {self.sample(0, mark, mark)}",
        ]

    COMMON = (
        "domain_arg: DomainArg, quadrature: QuadratureArg, fields: Fields, values: Values, "
        "tables: Tables"
    )
    REST = "s, domain_arg, fields, values, points"

    def _zeros(self, role) -> str:
        return "".join(f"Slot_{role.role}_{number}(), " for number, _ in role.used_slots)

    # Kernels.

    @functools.cached_property
    def structure(self):
        """Coefficients that are zero or constant; checks that the form is linear."""
        from warp._src.fem.forms.structure import Structure, find_structure

        if self._base is not None:
            return self._base.structure
        made = extend.remembered(
            ("structure", type(self).__name__, self.record), lambda: find_structure(self).encoded()
        )
        return Structure.decoded(made)

    @property
    def is_symmetric(self) -> bool:
        """True if element matrices are symmetric."""
        same = self.trial is not None and self.test.nodes == self.trial.nodes
        return same and self.structure.is_symmetric

    def slot_degree(self, role, slot) -> int:
        """Polynomial degree of a slot in reference coordinates."""
        element = role.nodes.element
        if element is None:
            return UNKNOWN
        lower = int(slot.is_gradient and element.cell.is_simplex)
        return max(0, element.monomial_degree - lower)

    @functools.cache  # noqa: B019 - plans live as long as the program
    def rows(self) -> list:
        """The components of the slots of the test function: (number, slot, subscript, name of a
        function that gives the coefficient)."""
        test, trial = self.test, self.trial
        count = len(test.used_slots)
        test_slots, trial_slots = self.slot_parameters[:count], self.slot_parameters[count:]
        parameters = _parameters([*trial_slots, *test_slots])
        given = "".join(f"{name}, " for name, _ in self.slot_parameters)
        made = []
        for place, (number, slot) in enumerate(test.used_slots):
            for index, subscript in enumerate(components(slot.type)):
                name = f"row_{number}_{index}"
                self.names[name] = self._function(
                    f"def {name}({parameters}s: Sample, domain_arg: DomainArg, fields: Fields, "
                    f"values: Values, points: Any):\n"
                    f"    found = gradient_by(form, {count})({given}{self.REST})\n"
                    f"    return found[{place}]{subscript}\n"
                )
                made.append((number, slot, subscript, name))
        return made if trial.used_slots else []

    @functools.cached_property
    def total_type(self):
        """Type of the integral over an element: that of the integrand, whose numbers have at least
        the precision of the geometry's."""
        if self.result is None:
            raise ValueError(
                f"integrand '{self.record.integrand.name}' gives no value to integrate"
            )
        scalar, real = extend.type_scalar_type(self.result), self.record.scalar
        return self.result if scalar in (real, wp.float64) else with_scalar(self.result, real)

    @functools.cached_property
    def totals(self):
        """Kernel of functionals: the integral over each element."""
        self.names["Result"] = self.total_type
        self.names["Wide"] = extend.type_scalar_type(self.total_type)
        value = f"scale * form({self.REST})"
        if extend.type_scalar_type(self.result) is not self.record.scalar:
            value = f"Wide(scale) * Result(form({self.REST}))"
        lines = [
            f"def functional({self.COMMON}, totals: wp.array(dtype=Result)):",
            "    domain_element = wp.tid()",
            "    total = Result()",
        ]
        self._loop(lines)
        lines += [
            f"        total += {value}",
            "    totals[domain_element] = total",
        ]
        return self._kernel("\n".join(lines) + "\n")

    @property
    def block_dtype(self):
        """Type of a block."""
        test, real = self.test.nodes.dof_dtype, self.record.scalar
        if self.trial is None:
            return test
        trial = self.trial.nodes.dof_dtype
        composites = (extend.type_is_vector, extend.type_is_matrix)
        if not any(is_kind(one) for is_kind in composites for one in (test, trial)):
            return real
        return wp.types.matrix((dof_count(test), dof_count(trial)), real)

    def check_result(self):
        """Raises unless a linear or bilinear form gives a number of the geometry's type."""
        if self.result is not self.record.scalar:
            shown = "nothing" if self.result is None else f"'{extend.type_repr(self.result)}'"
            raise ValueError(
                f"integrand '{self.record.integrand.name}' expects a result of type "
                f"'{extend.type_repr(self.record.scalar)}', the scalar type of the geometry, but "
                f"gives {shown}"
            )

    @functools.cached_property
    def blocks(self):
        """Kernel of element vectors or matrices."""
        self.check_result()
        from warp._src.fem.forms import literal
        from warp._src.fem.forms.element_kernels import bilinear_text, linear_text

        _ = self.structure
        if self.trial is None:
            return self._kernel(linear_text(self))
        if literal.applies(self):
            text, self.tensors = literal.literal_text(self)
            return self._kernel(text)
        from warp._src.fem.forms.factored import factored_text

        return self._kernel(factored_text(self) or bilinear_text(self))

    @functools.cached_property
    def repeats(self) -> bool:
        """True if all elements have one matrix."""
        from warp._src.fem.forms import literal

        return self.has_slots and self.trial is not None and literal.repeats(self)

    @functools.cached_property
    def row_blocks(self) -> tuple | None:
        """Kernel of element matrices by rows, for GPUs, and its threads for an element; or None."""
        from warp._src.fem.forms import literal, rows

        if self.trial is None:
            return None
        self.check_result()
        # Threads of a warp that have one element each read the same numbers of reference tensors.
        if literal.applies(self):
            return None
        made = rows.rows_text(self)
        return None if made is None else (self._kernel(made[0]), made[1])

    def more_values(self, device) -> list:
        """Arguments of the kernel of blocks beside those of all kernels."""
        if self.tensors is None:
            return []
        if device not in self._on_device:
            self._on_device[device] = wp.array(
                self.tensors, dtype=self.record.scalar, device=device
            )
        return [self._on_device[device]]


def encoded_type(dtype) -> tuple | None:
    """A type of numbers, vectors or matrices as plain values; None for others."""
    if dtype is None:
        return ("nothing",)
    composites = (extend.type_is_vector, extend.type_is_matrix)
    if not any(is_kind(dtype) for is_kind in composites):
        is_plain = getattr(wp, getattr(dtype, "__name__", ""), None) is dtype
        return ("number", dtype.__name__) if is_plain and hasattr(dtype(0), "value") else None
    return ("composite", extend.type_scalar_type(dtype).__name__, tuple(dtype._shape_))


def decoded_type(made):
    """The type that `encoded_type` was given."""
    kind, *rest = made
    if kind == "nothing":
        return None
    if kind == "number":
        return getattr(wp, rest[0])
    scalar, shape = getattr(wp, rest[0]), tuple(rest[1])
    return wp.types.vector(shape[0], scalar) if len(shape) == 1 else wp.types.matrix(shape, scalar)


def _any():
    from typing import Any

    return Any


@functools.cache
def _struct(name, fields):
    """A struct from pairs; one without fields has an unused one."""
    return extend.struct_from_fields(name, dict(fields) or {"unused": wp.int32}, module=__name__)
