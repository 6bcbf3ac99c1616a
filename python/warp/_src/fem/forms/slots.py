"""Slots of a form - reference values of its fields at a point, and which of them it uses."""

from __future__ import annotations

import functools
from dataclasses import dataclass

from warp._src.fem.fields.curvature import needs_curvature
from warp._src.fem.fields.spaces import NodeSpace, PointDescription, SpaceDescription
from warp._src.fem.forms.basis import Basis

_VALUES = {"inner": 0, "()": 0, "outer": 1}
_GRADIENTS = {"grad": 0, "div": 0, "curl_grad": 0, "grad_outer": 1, "div_outer": 1}
NODE_OPERATORS = frozenset(
    (
        *("at_node", "node_index", "node_count", "node_partition_index"),
        *("node_inner_weight", "node_outer_weight"),
        *("node_inner_weight_gradient", "node_outer_weight_gradient"),
    )
)


@dataclass(frozen=True)
class Slot:
    """One slot. half: 1 for the outer cell. is_gradient; type: of the slot."""

    half: int
    is_gradient: bool
    type: type


@dataclass(frozen=True)
class Role:
    """A field of a form whose values at points are slots.

    Attributes:
        name: of the parameter. role: test, trial or field_<name>, which texts of kernels begin
            names with. nodes: the space.
        used: numbers of the slots that the form depends on.
    """

    name: str
    role: str
    nodes: NodeSpace
    domain: object
    used: tuple | None = None

    @property
    def halves(self) -> int:
        """Cells that a point lies in."""
        return 1 if self.domain.is_cells else 2

    @functools.cached_property
    def slots(self) -> tuple:
        """All slots: value and gradient, of each cell."""
        value, gradient = self.nodes.values.reference_types(self.nodes.cell_dimension)
        return tuple(
            Slot(half, bool(kind), (value, gradient)[kind])
            for half in range(self.halves)
            for kind in (0, 1)
        )

    @property
    def used_slots(self) -> list:
        """(number, slot) of the slots that the form depends on."""
        return [(i, s) for i, s in enumerate(self.slots) if self.used is None or i in self.used]

    def description(self, moves) -> PointDescription:
        """The description that the integrand sees."""
        base = None
        if self.role not in ("test", "trial"):
            base = SpaceDescription(self.nodes, self.domain)
        return PointDescription(self.nodes, self.domain, self.role, moves, base)

    def basis(self, rule, half=0) -> Basis:
        """Basis functions at points of a rule, or at run time if that is None."""
        return Basis(self.nodes, self.domain, rule, half)

    def with_uses(self, operations) -> Role:
        """The role with the slots that operators need."""
        is_cells = self.domain.is_cells
        used = set()
        for name in operations:
            for first, halves in ((0, _VALUES), (1, _GRADIENTS)):
                if name in halves:
                    used.add(first + (0 if is_cells else 2 * halves[name]))
            if needs_curvature(self.domain, self.nodes.values.map, name):
                used.add(0 if is_cells else 2 * _GRADIENTS[name])
        return Role(self.name, self.role, self.nodes, self.domain, tuple(sorted(used)))
