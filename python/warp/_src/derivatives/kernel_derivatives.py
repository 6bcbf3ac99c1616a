"""Derivatives of kernels: made on first use, kept with the kernel, run like any launch.

The compiler turns the module of a native kernel into that of its adjoint (or of its tangent) for a
given set of arrays that have gradients. `KernelDerivatives` belongs to a kernel and has all that
were made; `launch` and `run_adjoint` choose one of them.
"""

from __future__ import annotations

from warp import _native, config
from warp._src import errors
from warp._src.arrays.gradients import gradient_type
from warp._src.derivatives import kept_derivatives
from warp._src.derivatives.derivative import KernelDerivative, differentiate, thread_count
from warp._src.derivatives.handles import show_gradients
from warp._src.derivatives.launch_gradients import gradients_of, make_gradients
from warp._src.derivatives.same_arrays import check_overlap
from warp._src.derivatives.wide_gradients import WideGradients
from warp._src.kernels.call import Call
from warp._src.kernels.epoch import Epoch


class KernelDerivatives:
    """The derivatives of one kernel.

    Attributes:
        kernel: the kernel in Python.
    """

    def __init__(self, kernel):
        self.kernel = kernel
        self._made: dict = {}
        self._plain: dict = {}
        # Plain adjoints by the policy at singular points and the set of arrays with gradients, a
        # bit for each: native kernels, or the parts of gathered ones; of the native kernel for
        # launches.
        self.ready: dict = {}
        # Identity of the settings that all derivatives were made with.
        self.epoch = None
        # Lines that were printed.
        self._noticed: set = set()

    def clear(self) -> None:
        """Forgets all."""
        self._made.clear()
        self._plain.clear()
        self.ready.clear()

    def adjoint(
        self, native, active, unique=True, tape=None, apart=(), same=(), unrecorded=False
    ) -> KernelDerivative:
        """The derivative of a native kernel in reverse mode.

        Args:
            native: what `prepare` or `specialize` of the kernel has returned.
            active: for each array among the arguments whether it has a gradient.
            unique: no array has an element twice, and no two share memory.
            tape: in place of the option of that name.
            apart: for each array whether no element of it is both read and written; may be
                empty.
            same: for each array the number of the one to use in its place (`same_arrays`); may be
                empty.
            unrecorded: there are no copies of what the launch has overwritten.

        Raises:
            WarpCodegenError: something active has no derivative.
        """
        options = self._options(tape, apart, same, unrecorded)
        return self._find(native, active, False, unique, **options)

    def _options(self, tape=None, apart=(), same=(), unrecorded=False) -> dict:
        """The options of `differentiate` in reverse mode."""
        options = {"tape": tape or self.kernel.option("tape"), "apart": apart}
        if same:
            options["same"] = same
        if unrecorded:
            options["unrecorded"] = True
        return options

    @staticmethod
    def _key(native, active, forward, unique, options) -> tuple:
        return (native, tuple(active), forward, unique, config.singular, *options.items())

    def tangent(
        self, native, active, unique=True, width=1, winners=False, same=()
    ) -> KernelDerivative:
        """The same in forward mode, with tangents along `width` directions.

        With `winners`, what is launched after it if several threads met at atomic extrema.
        """
        options = {"width": width, "winners": winners}
        if same:
            options["same"] = same
        return self._find(native, active, True, unique, **options)

    def made(self) -> list[tuple]:
        """Native kernels of all that there are, each after `adjoint` or `tangent`."""
        return [("tangent" if key[2] else "adjoint", one.native) for key, one in self._made.items()]

    def last_adjoint(self) -> KernelDerivative | None:
        """The derivative in reverse mode that was made last, None if there is none."""
        made = [one for key, one in self._made.items() if not key[2]]
        return made[-1] if made and self.epoch is Epoch.current else None

    def active_sets(self, native) -> list[tuple]:
        """Sets of arrays with a gradient that there are adjoints of a native kernel for."""
        if self.epoch is not Epoch.current:
            return []
        return [
            active
            for made, active, forward, unique, singular, *_ in self._made
            if made is native and unique and not forward and singular == config.singular
        ]

    def _find(self, native, active, forward, unique, **options):
        if self.epoch is not Epoch.current:
            self.clear()
            self.epoch = Epoch.current
        key = self._key(native, active, forward, unique, options)
        found = self._made.get(key)
        if found is None:
            name, made = kept_derivatives.find(self.kernel, native, key[1:])
            kept = made is not None
            if not kept:
                made = differentiate(native, active, forward, unique, **options)
            mode, unrecorded = "tangent" if forward else "adjoint", options.get("unrecorded", False)
            found = KernelDerivative(self.kernel, made, mode, unique, unrecorded)
            if name is not None and not kept:
                kept_derivatives.keep(name, made, found)
            self._made[key] = found
            self.notice(made.notices)
            given = unrecorded or options.get("apart") or options.get("same")
            if self.kernel.module.saved and unique and not forward and not given:
                self._use_saved(found, native, active)
        return found

    def notice(self, lines) -> None:
        """Prints lines about derivatives, each once."""
        for line in lines:
            if line not in self._noticed:
                self._noticed.add(line)
                print(line, flush=True)

    def _use_saved(self, derivative, native, active) -> None:
        from warp._src.derivatives.saved import parts, saved_name

        kernel = self.kernel
        tags = {made: f"{kernel.key}_{tag}" for tag, made in kernel.tagged_specializations()}
        for part, made in parts(derivative).items():
            kernel.use_saved(made, saved_name(tags.get(native, kernel.key), part, active))

    def launch(self, call: Call) -> None:
        """Runs the adjoint of a launch whose arrays have their gradients."""
        if not self.kernel.option("enable_backward"):
            raise errors.WarpGradientError(
                f"launch('{self.kernel.key}', adjoint=True): the kernel has "
                f"`enable_backward=False`, remove that option"
            )
        active = call.active
        same = check_overlap(call, active, ", adjoint=True")
        if any(active) and thread_count(call.dim):
            if call.stream is not None:
                make_gradients(call)
            wide = WideGradients(call)
            wide.load()
            self.run_adjoint(call, wide.values, same=same, unrecorded=True)
            wide.store()

    def plain(self, native, arrays) -> KernelDerivative | None:
        """The adjoint of a launch of these arrays if nothing but its arguments takes part.

        It is one that `launch` has made before; without arguments of its own, for launches of any
        extents, and none of the gradients has elements of 16 bits. The arrays and gradients are
        those of all arguments, and no two share memory.
        """
        if self.epoch is not Epoch.current:
            return None
        key = native, config.singular, tuple([one.requires_grad for one in arrays])
        if key not in self._plain:
            made = self._made.get(self._key(native, key[2], False, True, self._options()))
            if made is None:
                return None
            # The next array with elements of 16 bits may have other gradients.
            narrow = any(
                one.requires_grad and gradient_type(one.dtype) is not one.dtype for one in arrays
            )
            self._plain[key] = made if made.is_plain and not narrow else None
            if self._plain[key] and native is self.kernel.native:
                number = sum(has << i for i, has in enumerate(key[2]))
                parts = made.native if made.gathered is None else made.gathered.parts
                self.ready.setdefault(config.singular, {})[number] = parts
        return self._plain[key]

    def run_adjoint(
        self, call: Call, values, initial=None, saved=(), apart=(), same=(), unrecorded=False
    ) -> None:
        """Runs the adjoint of a launch.

        Args:
            call: the launch.
            values: its arguments.
            initial: copies of arrays as they were before the launch, by number.
            saved: what `run_augmented` of the adjoint has returned.
            apart: arrays that are read and written in different places, see `adjoint`.
            same: arguments that are one array, see `adjoint`.
            unrecorded: nobody has kept what the launch has overwritten.
        """
        made = self.adjoint(call.native, call.active, apart=apart, same=same)
        unrecorded = unrecorded and made.may_run_again
        if unrecorded:
            made = self.adjoint(call.native, call.active, True, None, apart, same, True)
        made.check_threads(call)
        # True if threads with different indices may meet at a gradient, also by handles.
        if _native.shares_elements([*gradients_of(call, values, same), *show_gradients()]):
            tape = "checkpoints" if made.counting is None else "global"
            made = self.adjoint(call.native, call.active, False, tape, apart, same, unrecorded)
        made.run(call, values, initial or {}, saved)
