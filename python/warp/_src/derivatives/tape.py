"""`wp.Tape`: records launches and runs their derivatives in reverse."""

from __future__ import annotations

import weakref

from warp import _native, config
from warp._src import errors
from warp._src.argument_kinds import (
    ARRAY,
    ARRAYS,
    CALLABLE,
    COUNT,
    DICT,
    DIM,
    FLAG,
    INTEGER,
    LIST,
    NAMES,
    TEXT,
    named,
)
from warp._src.arguments import checked, explained
from warp._src.arrays import lending
from warp._src.arrays.array import array
from warp._src.arrays.kept import Budget
from warp._src.arrays.observers import Observers, Observing
from warp._src.arrays.versions import event
from warp._src.derivatives import cotangents, foreign_writes
from warp._src.derivatives.tape_records import CopyRecord, FillRecord, FunctionRecord, LaunchRecord
from warp._src.devices.devices import resolve_index
from warp._src.kernels.call import Call
from warp._src.types.structs import StructInstance

_CALL = named("a launch that is to be recorded", "Call")
_RECORD = named("what `begin_launch` gave", "LaunchRecord")


class Tape(_native.Scope):
    """Records what is done to arrays in a `with` block, to compute gradients.

    Recorded are launches, `wp.map`, operators of arrays, `wp.copy`, `wp.clone`, `assign`, `fill_`
    and `zero_`. `backward` adds to the gradients (`array.grad`) of all arrays that have one.

    Args:
        preserve: "auto" keeps what a gradient depends on when it is overwritten; "never" makes
            that an error of `backward`, but for what a launch itself overwrites.
        max_bytes: how much "auto" may keep; by default a quarter of the device's memory. More is an
            error of `backward` that says what most of it was kept for.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def square(x: wp.array(dtype=float), loss: wp.array(dtype=float)):
        ...     i = wp.tid()
        ...     wp.atomic_add(loss, 0, x[i] * x[i])
        >>> x = wp.array([1.0, 2.0], dtype=float, requires_grad=True, device="cpu")
        >>> loss = wp.zeros(1, dtype=float, requires_grad=True, device="cpu")
        >>> with wp.Tape() as tape:
        ...     wp.launch(square, 2, [x, loss], device="cpu")
        >>> tape.backward(loss)
        >>> print(x.grad)
        [2. 4.]

    Attributes:
        loss: what `backward` was last called with.
        scopes: (number of records before, name or None at the end, metadata) of each scope's ends.
    """

    @checked(preserve=TEXT, max_bytes=COUNT)
    def __init__(self, preserve: str = "auto", max_bytes: int | None = None):
        if preserve not in ("auto", "never"):
            raise ValueError(f"preserve expects 'auto' or 'never', but got {preserve!r}")
        if max_bytes is not None and (not isinstance(max_bytes, int) or max_bytes < 0):
            raise ValueError(f"max_bytes expects a number of bytes or None, but got {max_bytes!r}")
        self.preserve = preserve
        self._budget = Budget(max_bytes) if preserve == "auto" else None
        self.loss: array | None = None
        self.scopes: list = []
        self._records: list = []
        self._solutions = None
        # Versions of the gradients as the last backward pass left them.
        self._left: list = []
        # The state before it was reset.
        self._former: list = []
        self._seeded: list = []
        # Writes of other libraries in between.
        self.foreign_writes: list = []

    # Recording.

    def __reduce__(self):
        if self._records:
            raise TypeError(
                "cannot pickle a tape with records: send arrays and gradients, and record where "
                "`backward` is to run"
            )
        return type(self), (self.preserve,)

    def _check(self):
        if Observers.tape is not None:
            raise errors.WarpError(
                "a tape is recording already: leave its block before, or record both parts on it"
            )

    def _enter(self):
        Observers.tape = self
        Observers.update()
        return self

    def _restore(self):
        if Observers.tape is self:
            lending.settle()
            Observers.tape = None
        Observers.update()

    def _add(self, record) -> None:
        self._records.append(record)
        Observers.retain(self)

    def ordinary_records(self) -> tuple:
        """The list that records launches without anything special, and the budget of their copies.

        None in place of the records if each overwriting is to be told at once.
        """
        if config.verify_autograd_array_access:
            return None, None
        return self._records, self._budget

    def begin_launch(self, call: Call) -> LaunchRecord:
        """Called before a launch that is to be recorded.

        Raises:
            TypeError: `call` is none.
        """
        try:
            return LaunchRecord(call.settled(), self._budget)
        except AttributeError as error:
            raise explained(error, "wp.Tape.begin_launch", call=(_CALL, call)) from None

    def end_launch(self, record: LaunchRecord) -> None:
        """Called after it.

        Raises:
            TypeError: `record` is not what `begin_launch` gave.
        """
        Observers.retain(self)
        try:
            record.observe()
        except AttributeError as error:
            raise explained(error, "wp.Tape.end_launch", record=(_RECORD, record)) from None
        self._add(record)

    def add_copy(self, dest, src, place) -> None:
        """Called after a copy.

        Raises:
            TypeError: `dest` or `src` is no array.
        """
        try:
            if dest.requires_grad:
                self._add(CopyRecord(dest, src, place))
        except AttributeError as error:
            given = {"dest": (ARRAY, dest), "src": (ARRAY, src)}
            raise explained(error, "wp.Tape.add_copy", **given) from None

    def add_fill(self, target, place) -> None:
        """Called after `fill_` and `zero_`.

        Raises:
            TypeError: `target` is no array.
        """
        try:
            if target.requires_grad:
                self._add(FillRecord(target, place))
        except AttributeError as error:
            raise explained(error, "wp.Tape.add_fill", target=(ARRAY, target)) from None

    @checked(dim=DIM, inputs=LIST, outputs=LIST, max_blocks=INTEGER, metadata=DICT)
    def record_launch(
        self,
        kernel,
        dim,
        max_blocks=0,
        inputs=(),
        outputs=(),
        device=None,
        block_dim=0,
        metadata=None,
    ) -> None:
        """Records a launch without running it.

        Raises:
            WarpLaunchTypeError: there are more or fewer arguments than parameters.
        """
        values = (*inputs, *outputs)
        if len(values) != kernel.func.__code__.co_argcount:
            raise errors.WarpLaunchTypeError(
                f"record_launch('{kernel.key}'): expects {kernel.func.__code__.co_argcount} "
                f"arguments, but got {len(values)}"
            )
        native = kernel.specialize(values) if kernel.is_generic else kernel.prepare()
        call = Call(kernel, native, dim, values, resolve_index(device), None, block_dim)
        self.end_launch(self.begin_launch(call))

    @checked(backward=CALLABLE, arrays=ARRAYS)
    def record_func(self, backward, arrays) -> None:
        """Records a function that is called in the backward pass.

        Args:
            backward: called without arguments; reads the gradients of what the forward code has
                written and adds to those of what it has read.
            arrays: arrays and structs whose gradients take part, for `zero` and `gradients`. With
                a right-hand side that the tape has computed of a first guess, and the solution that
                replaced the guess, derivatives of the right-hand side are those at the solution, as
                the implicit function theorem asks.
        """
        from warp._src.derivatives.implicit import Solutions

        record = FunctionRecord(backward, arrays, event("function"))
        self._solutions = self._solutions or Solutions()
        self._solutions.take(self._records, record.arrays(), record.event)
        self._add(record)

    def add_function(self, backward, arrays) -> None:
        """Records the adjoint of work of a library; arguments as for `record_func`."""
        self._add(FunctionRecord(backward, arrays, event("function")))

    @checked(scope_name=TEXT, metadata=DICT)
    def record_scope_begin(self, scope_name, metadata=None) -> None:
        """Begins a named group of records, shown by `visualize`. Groups nest."""
        self.scopes.append((len(self._records), scope_name, metadata or {}))

    def record_scope_end(self, remove_scope_if_empty=True) -> None:
        """Ends the innermost group."""
        begin = self._open_scope()
        if remove_scope_if_empty and self.scopes[begin][0] == len(self._records):
            del self.scopes[begin:]
            return
        self.scopes.append((len(self._records), None, None))

    def _open_scope(self) -> int:
        depth = 0
        for i in range(len(self.scopes) - 1, -1, -1):
            depth += 1 if self.scopes[i][1] is None else -1
            if depth < 0:
                return i
        raise errors.WarpError("record_scope_end: no scope is open", code="tape-scope")

    @property
    def kept_bytes(self) -> int:
        """Bytes of copies of what was overwritten; freed when the records are forgotten."""
        return 0 if self._budget is None else self._budget.used

    @property
    def launches(self) -> list:
        """The records, in order."""
        return self._records

    # Gradients.

    @checked(loss=ARRAY, grads=DICT)
    def backward(self, loss=None, grads=None, check_finite: bool = False) -> None:
        """Runs the records in reverse; gradients are added to those that are there.

        The values of `loss` and `grads` replace the gradients of those arrays; the arrays of seeds
        themselves are only read. Two passes in a row compute the same: what the first has left in
        gradients of intermediate results is no seed of the second.

        Args:
            loss: array of one element whose gradient is set to 1.
            grads: gradients of further results, as a dictionary from arrays to arrays of equal
                shape. Results get a gradient where they have none.
            check_finite: look for infinite numbers and NaN after each record and name the first
                one; slow.

        Raises:
            WarpGradientError: something that a gradient depends on has been overwritten, or a
                gradient is not finite.
            WarpCodegenError: a kernel cannot be differentiated.
        """
        from warp._src.derivatives.backward import BackwardPass

        lending.settle()
        if self.foreign_writes:
            foreign_writes.check(self)
        seeds = self._check_seeds(loss, grads)
        self.loss = loss if loss is not None else self.loss
        BackwardPass(self, seeds, check_finite).run()

    def _check_seeds(self, loss, grads) -> dict:
        seeds: dict = {}
        if loss is not None:
            if not isinstance(loss, array) or loss.size != 1:
                raise errors.WarpShapeError(
                    f"backward: expects a loss of one element, but got {loss!r}, "
                    f"pass gradients of larger results as `grads`"
                )
            if not loss.requires_grad:
                raise errors.WarpError(
                    "backward: the loss has no gradient, make it with `requires_grad=True`"
                )
            seeds[loss] = None
        for target, seed in (grads or {}).items():
            if not isinstance(target, array):
                raise errors.WarpTypeError(
                    f"backward: expects arrays as keys of `grads`, but got {target!r}",
                    hint="name the array behind an indexed array",
                )
            target.requires_grad = True
            if not isinstance(seed, array) or seed.shape != target.shape:
                raise errors.WarpShapeError(
                    f"backward: expects a gradient of shape {target.shape}, but got {seed!r}"
                )
            seeds[target] = cotangents.as_gradient(seed, target)
        return seeds

    def arrays(self) -> list[array]:
        """All arrays of the records, each once."""
        found = {id(one): one for one, *_ in _native.arrays_of_records(self._records, False)}
        for one in self._seeded:
            found[id(one)] = one
        return list(found.values())

    def zero(self) -> None:
        """Sets the gradients of all recorded arrays to zero."""
        with Observing(tape=None):
            for one in self.arrays():
                if one.grad_in_use is not None:
                    one.grad.zero_()

    def reset(self) -> None:
        """Sets the gradients to zero and forgets the records."""
        self.zero()
        structs = [value for record in self._records for value in getattr(record, "structs", ())]
        self._former = [weakref.ref(one) for one in (*self.arrays(), *structs)]
        self._records.clear()
        self._solutions = None
        if self._budget is not None:
            self._budget.forget()
        self.scopes.clear()
        self.foreign_writes.clear()
        self._left.clear()
        self._seeded.clear()
        self.loss = None
        Observers.release(self)

    @property
    def gradients(self) -> dict:
        """Gradients by array; structs have copies whose arrays are the gradients.

        After `reset` they are those of what the tape knew, as long as something else holds it.
        """
        found: dict = {}
        for one in (former() for former in self._former):
            if isinstance(one, StructInstance) or (one is not None and one.requires_grad):
                found[one] = self.get_adjoint(one)
        found.update({one: one.grad for one in self.arrays() if one.requires_grad})
        for record in self._records:
            for value in record.structs if isinstance(record, LaunchRecord) else ():
                found[value] = self.get_adjoint(value)
        return found

    @gradients.setter
    @checked(value=DICT)
    def gradients(self, value) -> None:
        # Programs forget what a tape knew that they have reset.
        if value:
            raise AttributeError("gradients of a tape are those of its arrays: set `array.grad`")
        self._former = []

    @checked()
    def get_adjoint(self, a):
        """The gradient of an array or, with its arrays replaced by theirs, of a struct.

        Other values have none and are returned as they are.
        """
        if isinstance(a, array):
            return a.grad
        if isinstance(a, StructInstance):
            return cotangents.gradient_struct(a)
        return a

    @checked(
        array_labels=DICT,
        track_inputs=ARRAYS,
        track_outputs=ARRAYS,
        track_input_names=NAMES,
        track_output_names=NAMES,
        graph_direction=TEXT,
        simplify_graph=FLAG,
        hide_readonly_arrays=FLAG,
        choose_longest_node_name=FLAG,
        ignore_graph_scopes=FLAG,
    )
    def visualize(
        self,
        filename: str | None = None,
        simplify_graph: bool = True,
        hide_readonly_arrays: bool = False,
        array_labels: dict | None = None,
        choose_longest_node_name: bool = True,
        ignore_graph_scopes: bool = False,
        track_inputs: list | None = None,
        track_outputs: list | None = None,
        track_input_names: list | None = None,
        track_output_names: list | None = None,
        graph_direction: str = "LR",
    ) -> str:
        """The records as a graph in the language of GraphViz.

        Args:
            filename: where to write the text, too.
            simplify_graph: show a kernel that is launched several times in a row once.
            hide_readonly_arrays: leave out arrays that no record writes.
            array_labels: names of arrays; others are called like the argument they are passed for.
            choose_longest_node_name: of several such names take the longest, else the first.
            ignore_graph_scopes: draw no boxes around scopes.
            track_inputs, track_outputs: arrays to emphasise.
            track_input_names, track_output_names: names of those.
            graph_direction: `LR`, `TB`, `RL` or `BT`.
        """
        from warp._src.derivatives.tape_graph import draw

        labels = dict(array_labels or {})
        for arrays, names in (
            (track_inputs, track_input_names),
            (track_outputs, track_output_names),
        ):
            labels.update(zip(arrays or (), names or (), strict=False))
        text = draw(
            self,
            labels,
            simplify=simplify_graph,
            hide_readonly=hide_readonly_arrays,
            longest=choose_longest_node_name,
            scopes=not ignore_graph_scopes,
            tracked=[*(track_inputs or ()), *(track_outputs or ())],
            direction=graph_direction,
        )
        if filename is not None:
            with open(filename, "w", encoding="utf-8") as file:
                file.write(text)
        return text
