"""Modules: the kernels and functions of one Python module, and the options they share."""

from __future__ import annotations

import sys
import types
import warnings
import weakref

from warp import _native, config
from warp._src import arguments, errors
from warp._src import config as settings
from warp._src.argument_kinds import DICT, KERNEL, LIST, MODULE, MODULES, TEXT, above
from warp._src.arguments import checked
from warp._src.devices import devices
from warp._src.kernels.build_options import Build, ModuleBuildOptions
from warp._src.weak import WeakObjects

# Options that change compiled code, with the setting that gives the default.
OPTIONS = {
    "max_unroll": "max_unroll",
    "inline_budget": "inline_budget",
    "enable_backward": "enable_backward",
    "fast_math": "fast_math",
    "lineinfo": "lineinfo",
    "mode": "mode",
    "optimization_level": "optimization_level",
    "deterministic": "deterministic",
    "ordered_slots": "ordered_slots",
    "tape": "tape",
    "cpu_lanes": None,
    "block_dim": None,
    "strip_hash": None,
    "extra_build_options": None,
}
# Options of the peer that change nothing here.
INERT_OPTIONS = {
    "fuse_fp",
    "cuda_output",
    "cpu_compiler_flags",
    "deterministic_max_records",
    "enable_mathdx_gemm",
    "enable_mathdx_solver",
    "enable_mathdx_fft",
    "compile_time_trace",
    "default_grid_stride",
}


# The values of options without effect where nobody has set them.
DEFAULTS = {"fuse_fp": True, "deterministic_max_records": 0}


class Options(dict):
    """Options that were set; asked for another one it gives the value in effect."""

    def __init__(self, module):
        super().__init__()
        self.module = weakref.ref(module)

    def __missing__(self, name):
        if name in OPTIONS:
            return self.module().option(name)
        if name in INERT_OPTIONS:
            return DEFAULTS.get(name)
        raise KeyError(name)


class Module:
    """The declarations of one Python module."""

    @checked()
    def __init__(self, name: str):
        self.name = name
        self.kernels = weakref.WeakValueDictionary()
        # Generic ones stay when their name is used for what declares an overload.
        self.generic_kernels: dict = {}
        self.options = Options(self)
        # The files that `load_aot_module` has read.
        self.saved: list = []
        # Changes with each call that makes compiled kernels stale.
        self.version = 0

    def __reduce__(self):
        raise TypeError(
            f"cannot pickle the module '{self.name}': send its kernels, or get it where it is "
            f"needed by `wp.get_module('{self.name}')`"
        )

    @checked(name=TEXT, own=DICT)
    def option(self, name, own=None):
        """Value of an option: the kernel's own, the module's, the setting's.

        Raises:
            KeyError: there is no such option.
        """
        if own is not None and name in own:
            return own[name]
        if name in self.options:
            return self.options[name]
        if name not in OPTIONS:
            raise errors.WarpKeyError(f"no module option '{name}', there are: {', '.join(OPTIONS)}")
        setting = OPTIONS[name]
        return getattr(config, setting) if setting else None

    def set_options(self, options: dict) -> None:
        """Changes options, for kernels that are compiled afterwards."""
        check_options(options)
        self.options.update(options)
        self.mark_modified()

    @checked()
    def load(self, device=None, block_dim=None, max_workers=None) -> bool:
        """Compiles all kernels for a device, or for all, so that errors show now."""
        load_kernels(self.natives(), device, block_dim, max_workers)
        return True

    def natives(self) -> list:
        """Native kernels of this module; of a generic one, those made so far."""
        found = []
        for kernel in list(self.kernels.values()):
            found += kernel.specializations if kernel.is_generic else [kernel.prepare()]
        return found

    def unload(self) -> None:
        """Forgets the compiled code of all kernels."""
        self.mark_modified()

    def mark_modified(self) -> None:
        """Lets kernels be translated anew, for example after a captured constant changed."""
        self.version += 1
        for kernel in self.kernels.values():
            kernel.reset()

    def __repr__(self):
        return f"Module({self.name!r}, kernels={list(self.kernels)})"


def check_options(options: dict) -> None:
    if not isinstance(options, dict):
        raise TypeError(f"module options must be a dict, but got '{type(options).__name__}'")
    for name, value in options.items():
        if name == "deterministic_max_records":
            _check_count(name, value)
        if name in INERT_OPTIONS:
            continue
        if name not in OPTIONS:
            raise ValueError(f"no module option '{name}'. Valid options: {', '.join(OPTIONS)}")
        if name == "extra_build_options" and value is not None:
            if not isinstance(value, ModuleBuildOptions):
                raise TypeError(
                    f"module option '{name}' must be a ModuleBuildOptions instance, "
                    f"but got '{type(value).__name__}'"
                )
            Build(value)
        if OPTIONS[name] and value is not None:
            settings.SETTINGS[OPTIONS[name]].check(value)


def _check_count(name, value) -> None:
    if not hasattr(value, "__index__") or isinstance(value, bool):
        raise TypeError(f"module option '{name}' expects an int, but got {value!r}")
    if value < 0:
        raise ValueError(f"module option '{name}' expects no negative number, but got {value}")


modules_by_name: dict[str, Module] = {}
# Modules of one kernel each, as long as somebody has it.
_unique = WeakObjects()


@checked()
def get_module(name: str) -> Module:
    """The module of a name; made if there is none."""
    found = modules_by_name.get(name)
    if found is None:
        found = modules_by_name[name] = Module(name)
    return found


def make_unique(home: str, kernel: str, number: int) -> Module:
    """A module for one kernel, below that of its function; its options are its own."""
    made = Module(f"{home}.{kernel}_{number}")
    _unique.add(made)
    return made


def all_modules() -> list[Module]:
    return [*modules_by_name.values(), *_unique]


def caller_module(depth: int = 2) -> Module:
    frame = sys._getframe(depth)
    while frame.f_globals.get("__name__") == arguments.__name__:
        frame = frame.f_back
    return get_module(frame.f_globals.get("__name__", "__main__"))


def _named(module) -> Module:
    if module is None:
        return caller_module(3)
    if isinstance(module, Module):
        return module
    return get_module(module if isinstance(module, str) else module.__name__)


def _loadable(module, recursive) -> Module:
    """The module to load.

    Raises:
        RuntimeError: no module of that name was imported, or it holds nothing of Warp.
    """
    if module is None or isinstance(module, Module):
        return _named(module)
    name = module if isinstance(module, str) else module.__name__
    below = [other for other in modules_by_name if f"{other}".startswith(name + ".")]
    # The modules of this package make their kernels when they are first used.
    is_own = name.partition(".")[0] == "warp" and name in sys.modules
    if not (name in modules_by_name or is_own or (recursive and below)):
        members = vars(sys.modules[name]).values() if name in sys.modules else ()
        marks = "_wp_struct_", "_wp_function_"
        if not any(getattr(member, mark, False) is True for member in members for mark in marks):
            raise RuntimeError(
                f"load_module(): module '{name}' does not contain any Warp kernels, functions, or "
                "structs" + ("" if name in sys.modules else "; import it first")
            )
    return get_module(name)


def imported_module(module) -> Module:
    """The module that a Python module, a name or a `Module` stands for.

    Raises:
        TypeError: it is none of these.
        RuntimeError: it has no kernels.
    """
    if not isinstance(module, (Module, str, types.ModuleType)):
        raise TypeError(f"expects a module or its name, but got '{type(module).__name__}'")
    if not isinstance(module, Module):
        name = module if isinstance(module, str) else module.__name__
        module = modules_by_name.get(name)
        if module is None:
            raise RuntimeError(f"module '{name}' has no kernels, or was not imported yet")
    return module


def load_kernels(natives, device, block_dim=None, max_workers=None) -> None:
    """Compiles native kernels for a device, devices or all, several at a time."""
    if device is None:
        chosen = devices.get_devices()
    else:
        several = isinstance(device, (list, tuple))
        chosen = [devices.get_device(one) for one in (device if several else [device])]
    jobs = [(native, one.index, block_dim or 0) for one in chosen for native in natives]
    workers = config.load_module_max_workers if max_workers is None else max_workers
    if (workers is None or workers > 1) and len(jobs) > 1:
        _native.load_kernels(jobs, workers or 0)
    else:
        for job in jobs:
            _native.load_kernel(*job)


@checked(options=DICT, module=MODULE)
def set_module_options(options: dict, module=None) -> None:
    """Sets options for the kernels of the calling module (or of `module`).

    Options that nobody knows are kept, and a warning says that they change nothing.

    Raises:
        ValueError, TypeError: an option has an impossible value.
    """
    module = _named(module)
    unknown = {}
    if isinstance(options, dict):
        unknown = {
            name: options[name] for name in options if name not in (*OPTIONS, *INERT_OPTIONS)
        }
        options = {name: options[name] for name in options if name not in unknown}
    for name in unknown:
        warnings.warn(
            f"no module option '{name}', it changes nothing. Valid options: {', '.join(OPTIONS)}",
            stacklevel=3,
        )
    module.options.update(unknown)
    module.set_options(options)


@checked(module=MODULE)
def get_module_options(module=None) -> dict:
    """The options in effect for the kernels of the calling module (or of `module`)."""
    module = _named(module)
    known = (*OPTIONS, *sorted(INERT_OPTIONS))
    return {name: module.options[name] for name in (*known, *(module.options.keys() - {*known}))}


@checked(module=MODULE)
def load_module(module=None, device=None, recursive=False, block_dim=None, max_workers=None):
    """Compiles the kernels of the calling module (or of `module`) before their first launch.

    Args:
        module: a module, its name, or what `wp.get_module` gives.
        device: device or devices, by default all.
        recursive: the modules below it, too.
        block_dim: CUDA threads per block that launches will ask for.
        max_workers: threads that compile; 0 is serial, None what
            `wp.config.load_module_max_workers` says.

    Raises:
        RuntimeError: no module of that name was imported, or it holds nothing of Warp.
        WarpCodegenError: a kernel cannot be translated.
    """
    module = _loadable(module, recursive)
    try:
        natives = module.natives()
        if recursive:
            for other in all_modules():
                if other.name.startswith(module.name + "."):
                    natives += other.natives()
    except errors.WarpCodegenError as problem:
        # Says where in the kernel. Who keeps it is not to keep the kernel, too.
        raise problem.with_traceback(None) from problem.__cause__
    load_kernels(natives, device, block_dim, max_workers)


@checked(modules=MODULES)
def force_load(device=None, modules=None, block_dim=None, max_workers=None) -> None:
    """Compiles the kernels of all modules (or of `modules`) before their first launch."""
    natives = []
    for module in all_modules() if modules is None else modules:
        natives += _named(module).natives()
    load_kernels(natives, device, block_dim, max_workers)


@checked(kernels=LIST | KERNEL)
def compile(kernels, device=None, block_dim=None) -> None:
    """Compiles kernels before their first launch, on all processors.

    A launch of another kind than the usual one (over arrays that are not packed, or of another
    rank than the kernel asks `wp.tid` for) still compiles code of its own.

    Args:
        kernels: a kernel, or a list of them; of a generic one, the instances made so far.
        device: device or devices, by default the current one.
        block_dim: CUDA threads per block that launches will ask for.

    Raises:
        TypeError: something in `kernels` is no kernel.
        WarpCodegenError: a kernel cannot be translated.

    Example:
        >>> wp.compile([integrate, collide], "cpu")  # doctest: +SKIP
    """
    natives = []
    for kernel in kernels if isinstance(kernels, (list, tuple)) else [kernels]:
        if not KERNEL.fits(kernel):
            raise errors.WarpTypeError(
                f"compile: expects kernels, but got '{type(kernel).__name__}'"
            )
        try:
            natives += kernel.specializations if kernel.is_generic else [kernel.prepare()]
        except errors.WarpCodegenError as problem:
            raise problem.with_traceback(None) from problem.__cause__
    load_kernels(natives, devices.get_device() if device is None else device, block_dim)


def kernel_name(func) -> str:
    """Name of a function without the parts that Python adds for enclosing functions."""
    return (
        func.__qualname__.replace(".<locals>", "").replace(".", "_").replace("<lambda>", "lambda")
    )


above.imported_module = imported_module
