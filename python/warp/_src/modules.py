"""Modules: the kernels and functions of one Python module, and the options they share."""

from __future__ import annotations

import sys
import weakref

from warp._src import config as settings

# Options that change compiled code, with the setting that gives the default.
OPTIONS = {
    "max_unroll": "max_unroll",
    "enable_backward": "enable_backward",
    "fast_math": "fast_math",
    "lineinfo": "lineinfo",
    "mode": "mode",
    "optimization_level": "optimization_level",
    "block_dim": None,
}
# Options of the peer that change nothing here.
INERT_OPTIONS = {
    "fuse_fp",
    "cuda_output",
    "cpu_compiler_flags",
    "deterministic",
    "deterministic_max_records",
    "enable_mathdx_gemm",
    "enable_mathdx_solver",
    "enable_mathdx_fft",
    "compile_time_trace",
    "strip_hash",
    "extra_build_options",
    "default_grid_stride",
}


class Module:
    """What one Python module has declared."""

    def __init__(self, name: str):
        self.name = name
        self.kernels = weakref.WeakValueDictionary()
        self.options: dict = {}
        # Changes with each call that makes compiled kernels stale.
        self.version = 0

    def option(self, name, own=None):
        """Value of an option: the kernel's own, the module's, the setting's."""
        if own is not None and name in own:
            return own[name]
        if name in self.options:
            return self.options[name]
        from warp import config

        setting = OPTIONS[name]
        return getattr(config, setting) if setting else None

    def set_options(self, options: dict) -> None:
        check_options(options)
        self.options.update(options)
        self.mark_modified()

    def load(self, device=None, block_dim=None) -> bool:
        """Translates all kernels, so that errors show now."""
        for kernel in list(self.kernels.values()):
            if not kernel.is_generic:
                kernel.prepare()
        return True

    def unload(self) -> None:
        self.mark_modified()

    def mark_modified(self) -> None:
        """Lets kernels be translated anew, for example after a captured constant changed."""
        self.version += 1
        for kernel in self.kernels.values():
            kernel.reset()

    def __repr__(self):
        return f"Module({self.name!r}, kernels={list(self.kernels)})"


def check_options(options: dict) -> None:
    for name, value in options.items():
        if name in INERT_OPTIONS:
            continue
        if name not in OPTIONS:
            known = ", ".join(OPTIONS)
            raise ValueError(f"no module option '{name}', there is: {known}")
        if OPTIONS[name] and value is not None:
            settings.SETTINGS[OPTIONS[name]].check(value)


_modules: dict[str, Module] = {}


def get_module(name: str) -> Module:
    """The module of a name; made if there is none."""
    found = _modules.get(name)
    if found is None:
        found = _modules[name] = Module(name)
    return found


def all_modules() -> list[Module]:
    return list(_modules.values())


def caller_module(depth: int = 2) -> Module:
    return get_module(sys._getframe(depth).f_globals.get("__name__", "__main__"))


def _named(module) -> Module:
    if module is None:
        return caller_module(3)
    if isinstance(module, Module):
        return module
    return get_module(module if isinstance(module, str) else module.__name__)


def set_module_options(options: dict, module=None) -> None:
    """Sets options for the kernels of the calling module (or of `module`).

    Raises:
        ValueError, TypeError: an option is unknown or has an impossible value.
    """
    _named(module).set_options(options)


def get_module_options(module=None) -> dict:
    """The options in effect for the kernels of the calling module (or of `module`)."""
    module = _named(module)
    return {name: module.option(name) for name in OPTIONS}


def load_module(module=None, device=None, recursive=False, block_dim=None, max_workers=None):
    """Translates the kernels of the calling module (or of `module`) before their first launch."""
    module = _named(module)
    module.load(device, block_dim)
    if recursive:
        for other in all_modules():
            if other.name.startswith(module.name + "."):
                other.load(device, block_dim)


def force_load(device=None, modules=None, block_dim=None, max_workers=None) -> None:
    """Translates the kernels of all modules (or of `modules`) before their first launch."""
    for module in all_modules() if modules is None else modules:
        _named(module).load(device, block_dim)
