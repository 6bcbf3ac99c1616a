"""Kernels: Python functions that become device code.

Decorating only records the function. The first launch translates it (`warp._src.frontend`) and
makes the native kernel, which compiles a variant for each kind of launch it sees. A change of a
setting or module option that matters to code drops the native kernel, not the Python object.
"""

from __future__ import annotations

import functools
import sys
import types as python_types

from warp import _native, config
from warp._src import config as settings
from warp._src import errors
from warp._src.argument_kinds import (
    DICT,
    DIM,
    FUNCTION,
    INTEGER,
    LIST,
    NONE,
    TEXT,
    TRANSLATION,
    instance,
)
from warp._src.arguments import checked, misfit
from warp._src.derivatives.kernel_derivatives import KernelDerivatives
from warp._src.forks import translating
from warp._src.kernels import declared, shown, unique
from warp._src.kernels.epoch import Epoch
from warp._src.kernels.hooks import LaunchHook
from warp._src.kernels.kernel_options import ordered_threads
from warp._src.kernels.modules import Module, get_module, kernel_name
from warp._src.kernels.specializing import argument_type, once, type_tag
from warp._src.types.annotations import annotations_of, check_annotations, is_generic


class Kernel:
    """A function that runs once per thread of a launch.

    Args:
        func: the Python function; every parameter is annotated.
        key: name in messages and in compiled code.
        module: module whose options apply, by default that of the function.
        options: the kernel's own options, by name.
        code_transformers: `ast.NodeTransformer`s, which get the syntax tree of the function, one
            after the other, before it is translated.
        source: text that takes the place of the function's, with the same parameters.

    Attributes:
        hooks: what launches do besides running native code (`LaunchHook`).
    """

    # The name by which a kernel with a module of its own is given again (kernels.unique).
    unique_key = None

    @checked(func=FUNCTION, source=TEXT | NONE)
    def __init__(
        self, func, key=None, module=None, options=None, code_transformers=None, source=None
    ):
        if not isinstance(func, python_types.FunctionType):
            raise TypeError(f"expects a function as kernel, but got '{type(func).__name__}'")
        check_annotations(func.__name__, func.__annotations__)
        if source is not None:
            from warp._src.kernels.made_functions import with_source

            func = with_source(func, source)
        if code_transformers:
            from warp._src.kernels.made_functions import transformed_function

            func = transformed_function(func, code_transformers)
        self.func = func
        self.key = key or kernel_name(func)
        self.module = (
            module if isinstance(module, Module) else get_module(module or func.__module__)
        )
        self.options = dict(options or {})
        declared.keep(func)
        self.module.kernels[self.key] = self
        self.module.generic_kernels.pop(self.key, None)
        if any(map(is_generic, func.__annotations__.values())):
            self.module.generic_kernels[self.key] = self
        self.epoch = None
        self.native = None
        self.hooks: tuple[LaunchHook, ...] = ()
        self._generic = None
        self._specialized: dict = {}
        # The epoch of these two, and what was made in others.
        self._made_in = None
        self._elsewhere: dict = {}
        # Facts that launches need about native kernels while somebody observes.
        self.signatures: dict = {}
        # Made by `wp.overload`, by the types of the parameters.
        self.declared_overloads: dict = {}
        # Names of native kernels in the kernel cache, of those that have one.
        self.names: dict = {}
        self.__name__ = func.__name__
        self.__qualname__ = func.__qualname__
        self.__module__ = func.__module__
        self.__doc__ = func.__doc__
        self.__wrapped__ = func
        if self.options.get("launch_constants"):
            from warp._src.kernels.constants import ConstantCode

            self.add_hook(ConstantCode(self))

    @property
    def is_generic(self) -> bool:
        """True if a parameter's type is left open."""
        if self._generic is None:
            with translating:
                self._generic = self._find_generic()
        return self._generic

    def _find_generic(self) -> bool:
        try:
            found = annotations_of(self.func).items()
            return any(is_generic(one) for name, one in found if name != "return")
        except Exception:
            # The translation says what is wrong.
            return False

    @property
    def overloads(self) -> dict:
        """The instances of a generic kernel, by the types of the parameters."""
        launched = {", ".join(map(str, types)): one for types, one in self._specialized.items()}
        return {**launched, **self.declared_overloads}

    @checked(arg_types=LIST | DICT)
    def add_overload(self, arg_types):
        """A kernel for given types of arguments, as `wp.overload(kernel, arg_types)` makes it."""
        from warp._src.kernels.overloads import overload

        return overload(self, arg_types)

    get_overload = add_overload

    @property
    def specializations(self) -> list:
        """Native kernels made for the arguments of a generic kernel."""
        return list(self._specialized.values())

    @property
    def adj(self):
        """Parameters as packages read them that know the peer's generator of code."""
        from warp._src.compat.codegen import adjoint_of

        return adjoint_of(self)

    @checked(name=TEXT)
    def option(self, name):
        """The value of an option: the kernel's own, its module's, or that of `wp.config`."""
        return self.module.option(name, self.options)

    def reset(self) -> None:
        """Forgets the translation."""
        self.epoch = None
        self.native = None
        self._specialized = {}
        self._elsewhere.clear()
        self._made_in = None
        if "derivatives" in self.__dict__:
            self.derivatives.clear()
        self.signatures.clear()
        self.names.clear()
        for hook in self.hooks:
            hook.reset()

    def prepare(self, threads=None):
        """Translates the kernel if that is due, and returns the native kernel.

        threads: of the blocks of a launch, should it be impossible for blocks of one thread.

        Raises:
            WarpCodegenError: the function cannot be translated.
        """
        epoch = Epoch.current
        if self.epoch is not epoch:
            # The first of several threads translates; the others find what it made.
            with translating:
                self._enter(epoch)
                if self.native is None:
                    self.native = self._translate(None, 1, None, threads)
                # Launches look at this first: from now on `native` is what they need.
                self.epoch = epoch
        return self.native

    def _enter(self, epoch) -> None:
        """Puts aside what was made for other settings, and takes what was made for these."""
        if self._made_in is epoch:
            return
        if self._made_in is not None:
            self._elsewhere[self._made_in] = self.native, self._specialized
            if len(self._elsewhere) > 4:
                del self._elsewhere[next(iter(self._elsewhere))]
                # It holds native kernels; those without a name make their derivatives anew.
                self.names.clear()
        self.native, self._specialized = self._elsewhere.pop(epoch, (None, {}))
        self.epoch, self._made_in = None, epoch

    def hook(self, role):
        """The launch hook of a role; None if the kernel has none."""
        return next((one for one in self.hooks if one.role == role), None)

    def add_hook(self, hook: LaunchHook) -> None:
        """Makes every launch call a hook, in place of one of its role if there is one.

        Raises:
            WarpArgumentError: `hook` is no launch hook.
        """
        if not isinstance(hook, LaunchHook):
            raise misfit("wp.Kernel.add_hook", "hook", instance(LaunchHook, "a launch hook"), hook)
        self.hooks = (*(one for one in self.hooks if one.role != hook.role), hook)

    @property
    def has_regions(self) -> bool:
        """True if it is known which elements of arrays a launch accesses."""
        return all(hook.has_regions for hook in self.hooks)

    @property
    def constant_sets(self) -> tuple:
        """The values that launches gave to the launch constants so far; empty without any."""
        hook = self.hook("constants")
        return () if hook is None else hook.sets

    def check(self, values, device) -> None:
        """Lets the hooks check the values of a launch on a device (an index).

        Raises:
            WarpError: a hook rejects them.
        """
        for hook in self.hooks:
            hook.check(self, values, device)

    def place(self, native, dim, index, block_dim, values, recorded=False):
        """Lets the hooks choose the code of a launch.

        Args:
            native: the native kernel, as `prepare` and `specialize` give it.
            dim: extent or extents.
            index: of the device; negative is the CPU.
            block_dim: threads per block that the launch asks for, or None.
            values: what the launch is given.
            recorded: True if arguments may change before the launch runs.

        Returns:
            The native kernel for the launch, and its threads per block.

        Raises:
            WarpError: a hook rejects the launch.
        """
        for hook in self.hooks:
            native, block_dim = hook.place(self, native, dim, index, block_dim, values, recorded)
        return native, block_dim

    @checked(arguments=LIST)
    def specialize(self, arguments, threads=None):
        """The native kernel of a generic kernel for the types of these arguments.

        threads: as for `prepare`.

        Raises:
            WarpLaunchTypeError: there are more or fewer arguments than parameters.
        """
        count = self.func.__code__.co_argcount
        if len(arguments) != count:
            raise errors.WarpLaunchTypeError(
                f"launch('{self.key}'): expects {count} arguments, but got {len(arguments)}"
            )
        types = tuple(map(argument_type, arguments))
        self._enter(Epoch.current)
        return once(self._specialized, types, lambda: self._translate(types, 1, None, threads))

    def _translate(self, arguments, threads=1, constants=None, wished=None):
        if self.unique_key is not None:
            unique.check(self)
        with translating:
            from warp._src.kernels.translations import native_kernel

            try:
                native = native_kernel(self, arguments, threads, constants)
            except errors.WarpCodegenError as problem:
                if threads != 1 or constants or not problem.depends_on_threads:
                    raise
                from warp._src.kernels.blocks import for_more_threads

                return for_more_threads(self, problem, arguments, wished)
        shown.dump(self, native)
        if "IPython" in sys.modules:
            from warp._src.kernels import changed_globals

            changed_globals.watch(self)
        name = self.key if arguments is None else f"{self.key}_{type_tag(arguments)}"
        self.use_saved(native, name)
        return native

    @checked()
    def use_saved(self, native, name) -> None:
        """Lets a native kernel launch what a module in a file has for it."""
        for saved in self.module.saved:
            try:
                saved.attach(native, name)
            except errors.WarpError:
                continue

    @property
    def is_deterministic(self) -> bool:
        """True if sums have to have the same bits in every run."""
        return self.option("deterministic") not in (False, None, "", "not_guaranteed")

    @checked(module=TRANSLATION)
    def compile_module(self, module, checked=False):
        """A native kernel from a module: this kernel or what is made of it, with its options.

        Args:
            module: or a translation from the cache.
            checked: keeps assertions.
        """
        level = self.option("optimization_level")
        bounds = self.options.get("launch_bounds", (0, 0))
        _native.set_lane_trials(config.check_lanes)
        _native.set_schedule_trials(config.check_schedules)
        return _native.Kernel(
            module,
            self.key,
            debug=checked or self.option("mode") == "debug",
            fast_math=self.option("fast_math"),
            lineinfo=self.option("lineinfo"),
            opt_level=2 if level is None else level,
            quick_first=level is None,
            block_dim=self.option("block_dim") or 256,
            max_registers=self.options.get("cuda_max_registers") or 0,
            max_threads=bounds[0],
            min_blocks=bounds[1],
            lanes=self.option("cpu_lanes") or 0,
            deterministic=self.is_deterministic,
            same_on_devices=self.option("deterministic") in settings.SAME_ON_DEVICES,
            ordered_slots=ordered_threads(self.option("ordered_slots")),
        )

    @functools.cached_property
    def derivatives(self) -> KernelDerivatives:
        """Its derivatives, each made on first use."""
        return KernelDerivatives(self)

    def tagged_specializations(self) -> list:
        """The instance for the arguments of a generic kernel, as (tag, native kernel)."""
        if self._made_in is not Epoch.current:
            return []
        return [(type_tag(types), native) for types, native in self._specialized.items()]

    @checked(stage=TEXT, rank=INTEGER, arch=INTEGER, derivative=TEXT, inputs=LIST)
    def ir(
        self,
        stage: str = "warp",
        device=None,
        rank: int | None = None,
        arch=None,
        derivative: str | None = None,
        inputs=None,
    ) -> str:
        """The kernel as text at one stage of compilation.

        Args:
            stage: `warp` (what the front end built), `thread` (scalars, one thread), `launch`,
                `gpu` (MLIR's dialect for GPUs of any maker), `llvm`, `ptx` or `asm`; or `adjoint`
                or `tangent`, the derivative if every array has a gradient.
            device: with `thread`, `launch` and `llvm`, the device to lower for; `gpu` and `ptx` are
                always for a GPU (that of the device, or a current one if there is none) and `asm`
                for the CPU.
            rank: number of launch dimensions; by default as many as the kernel asks `wp.tid()` for.
            arch: GPU architecture to lower for, `90` for `sm_90`; no such GPU is needed.
            derivative: `adjoint` or `tangent`: the stage of that derivative, in place of the
                kernel's.
            inputs: names of the arrays that have gradients, with a derivative; all by default.

        Raises:
            ValueError: there is no such stage, derivative, architecture or array.
        """
        return shown.text_of(self, stage, device, rank, arch, derivative, inputs)

    def code_for(self, native, arch):
        """The code for an architecture; 0 is the CPU."""
        for hook in self.hooks:
            native = hook.code_for(self, native, arch)
        return native

    def launched_on(self, native, arch) -> list:
        """The native kernels that launches on an architecture have used."""
        found = [native]
        for hook in self.hooks:
            found = [made for one in found for made in hook.launched_on(self, one, arch)]
        return found

    @checked(dim=DIM, arch=INTEGER)
    def schedule(self, device=None, dim=None, arch=None):
        """How launches of the kernel are made, and why; `print` shows it as a table.

        Nothing of this is kept by launches: the kernel is compiled again to find out.

        Args:
            device: where launches run; by default the current device.
            dim: extent, or extents, of a launch over packed arrays to look at. Without it there is
                an entry for each kind of launch made so far.
            arch: GPU architecture, `90` for `sm_90`, in place of a device; no such GPU is needed.

        Returns:
            A tuple of `Schedule`s.

        Raises:
            ValueError: there is no such architecture.
            RuntimeError: the kernel is generic.

        Example:
            >>> print(scale.schedule("cpu", dim=1000))  # doctest: +SKIP
            scale: cpu, 1 dimension
              lanes             16: worth it
              ...
        """
        from warp._src.kernels.schedule import schedules_of

        return schedules_of(self, device, dim, arch)

    def __call__(self, *args, **kwargs):
        raise errors.WarpLaunchTypeError(
            f"kernel '{self.key}' cannot be called, use `wp.launch({self.key}, dim, inputs)`"
        )

    def __repr__(self):
        return f"<kernel '{self.key}'>"

    def _repr_html_(self):
        from warp._src.notebooks import kernel_html

        return kernel_html(self)
