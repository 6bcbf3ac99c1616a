"""Domains in integrands - the record that a `Domain` parameter is bound to."""

import dataclasses

import warp as wp
from warp import extend
from warp._src.fem.domains import DomainRecord
from warp._src.fem.types import Domain

# Operators whose function takes the domain's index argument, too.
_OF_INDEX = ("element_index", "element_partition_index")
_OF_BOTH = ("partition_lookup",)


@dataclasses.dataclass(frozen=True)
class DomainDescription(extend.Description, Domain):
    """A domain; its part is a `DomainArg`."""

    record: DomainRecord

    def operation(self, name, count):
        if name == "scalar_type":
            return extend.Static(self.record.geometry.scalar)
        functions = self.record.functions
        if name == "cells":
            return extend.Recast(DomainDescription(self.record.cells), functions.domain_cell_arg)
        name = "position" if name == "()" else name
        short = name.removeprefix("element_")
        found = getattr(functions, f"element_{short}", None) or getattr(functions, name, None)
        if not isinstance(found, wp.Function):
            if name == "lookup" and not self.record.is_cells:
                raise TypeError("'lookup' is not defined on sides: use `lookup(cells(domain), x)`")
            return None
        if name in _OF_BOTH:
            return found
        return extend.OnField(found, "index" if name in _OF_INDEX else "geo")

    def __str__(self):
        return f"domain of {self.record.kind} of a {self.record.geometry.kind}"
