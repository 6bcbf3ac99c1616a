"""The translator of a function: a context, and a part for each topic."""

from __future__ import annotations

import ast
from functools import cached_property

from warp._src.frontend import names
from warp._src.frontend.access import Access
from warp._src.frontend.binder import Binder
from warp._src.frontend.branches import Branches
from warp._src.frontend.calls import Calls
from warp._src.frontend.constructors import Constructors
from warp._src.frontend.context import Context
from warp._src.frontend.custom_derivatives import CustomDerivatives
from warp._src.frontend.derivative_calls import DerivativeCalls
from warp._src.frontend.expressions import Expressions
from warp._src.frontend.geometry import Geometry
from warp._src.frontend.indexed import Indexed
from warp._src.frontend.local_arrays import LocalArrays
from warp._src.frontend.loops import Loops
from warp._src.frontend.output import Output
from warp._src.frontend.records import Records
from warp._src.frontend.references import References
from warp._src.frontend.session import Session
from warp._src.frontend.slices import Slices
from warp._src.frontend.slots import Slots
from warp._src.frontend.spreads import Spreads
from warp._src.frontend.statements import Statements
from warp._src.frontend.tables import Tables
from warp._src.frontend.targets import Targets
from warp._src.frontend.user_calls import UserCalls

_PARTS = {
    "access": Access,
    "binder": Binder,
    "branches": Branches,
    "calls": Calls,
    "constructors": Constructors,
    "custom_derivatives": CustomDerivatives,
    "derivative_calls": DerivativeCalls,
    "expressions": Expressions,
    "geometry": Geometry,
    "indexed": Indexed,
    "local_arrays": LocalArrays,
    "loops": Loops,
    "output": Output,
    "records": Records,
    "references": References,
    "slices": Slices,
    "slots": Slots,
    "spreads": Spreads,
    "statements": Statements,
    "tables": Tables,
    "targets": Targets,
    "user_calls": UserCalls,
}
# The part and the method that translate a kind of expression, and a builtin without a call in its
# record, by its name.
_HANDLERS = {
    getattr(ast, method[5:]) if method.startswith("expr_") else method[8:]: (part, method)
    for part, kind in _PARTS.items()
    for method in vars(kind)
    if method.startswith(("expr_", "builtin_"))
}
names.SPECIAL_BUILTINS.update(key for key in _HANDLERS if isinstance(key, str))


class Translator(Context):
    """Translates one function for given argument types.

    Attributes:
        methods: what `method` has found so far.
    """

    def __init__(self, session: Session, function, source, is_kernel: bool):
        super().__init__(session, function, source, is_kernel)
        self.methods = {}
        for name, kind in _PARTS.items():
            setattr(self, name, kind(self))

    def method(self, key):
        """The method for a kind of syntax or the name of a builtin; None if there is none."""
        part, name = _HANDLERS.get(key, (None, None))
        if part is None:
            return None
        method = self.methods[key] = getattr(getattr(self, part), name)
        return method

    @cached_property
    def tiles(self):
        """The part about tiles, which most kernels do without."""
        from warp._src.frontend.tiles import Tiles

        return Tiles(self)
