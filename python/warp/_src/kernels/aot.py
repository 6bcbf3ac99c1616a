"""Compiling ahead of time: modules in files.

`compile_aot_module` writes one file per target (`wp_<module>_<hash>.cpu.warp`, `….sm_90.warp`), in
the format that `include/warp/SavedModule.h` describes; C++ programs read the same files.
`load_aot_module` gives the code to the kernels of a module, which then launch it instead of
compiling.
"""

from __future__ import annotations

import os
import typing

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import GRADIENTS, MODULE
from warp._src.arguments import checked
from warp._src.devices.devices import get_cuda_devices, get_device
from warp._src.kernels.modules import Module, imported_module

if typing.TYPE_CHECKING:
    from pathlib import Path

_SUFFIX = ".warp"


@checked(module=MODULE, gradients=GRADIENTS)
def compile_aot_module(
    module,
    device=None,
    arch=None,
    module_dir=None,
    use_ptx=None,
    strip_hash=None,
    enable_backward=None,
    gradients=None,
) -> list[Path]:
    """Compiles all kernels of a module and saves them to files.

    Kernels whose parameter types are open are saved for the types that they were launched with or
    that `wp.overload` named.

    Args:
        module: a module, its name, or what `wp.get_module` gives.
        device: device or devices to compile for; by default the current one, unless `arch` is
            given.
        arch: GPU architecture or architectures, `90` for `sm_90`; no GPU is needed.
        module_dir: folder of the files, by default that of the kernel cache.
        use_ptx: True keeps PTX, which any later GPU runs, and writes each variant's beside the
            file, for other tools; False makes machine code, for which a GPU of that architecture
            must be there. By default PTX for an architecture and machine code for a device.
        strip_hash: leave the hash of the kernels out of the file name.
        enable_backward: save adjoints, too; by default of those kernels for which the option of
            that name was set to True, by the kernel or its module. There is one adjoint for the
            case that every floating-point array has a gradient, unless that has no derivative, and
            one for each case that backward passes have had so far.
        gradients: the cases to save instead, by name of the kernel: lists of names of the arrays
            that have a gradient; `s.x` is an array in a struct.

    Returns:
        The paths of the files.

    Raises:
        WarpCodegenError: a kernel cannot be translated.
        RuntimeError: the module has no kernels, or a file cannot be written.
        ValueError: an architecture is unknown, or a kernel or array that `gradients` names.
    """
    module = imported_module(module)
    _set_strip(module, strip_hash)
    kernels = _named_kernels(module)
    if not kernels:
        raise errors.WarpError(
            f"module '{module.name}' has no kernels to compile",
            hint="give generic kernels overloads by `wp.overload`",
            code="aot-empty",
        )
    _warn_of_generic(module)
    folder = _folder(module_dir)
    folder.mkdir(parents=True, exist_ok=True)
    stem = _stem(module, kernels)
    kernels += _adjoints(module, enable_backward, gradients or {})
    paths = []
    for architecture, index in _targets(device, arch, use_ptx):
        path = folder / f"{stem}.{_target_name(architecture)}{_SUFFIX}"
        _native.save_module(str(path), module.name, kernels, architecture, index)
        paths.append(path)
        if use_ptx and architecture:
            from warp.saved import extract

            extract(path, folder)
    return paths


@checked(module=MODULE)
def load_aot_module(
    module, device=None, arch=None, module_dir=None, use_ptx=None, strip_hash=None
) -> None:
    """Lets the kernels of a module launch code that `compile_aot_module` saved.

    Launches and backward passes that no saved code fits are compiled as usual.

    Args:
        module: a module, its name, or what `wp.get_module` gives.
        device: device or devices to load for, by default the current one.
        arch: architecture in the name of the file, by default that of the device, or an older one.
        module_dir: folder of the files, by default that of the kernel cache.
        use_ptx: has no effect: the file says what it holds.
        strip_hash: whether the file name lacks the hash.

    Raises:
        FileNotFoundError: there is no file; the message lists the names that were tried.
        RuntimeError: a file is damaged, or made by a release with another format.
        WarpCodegenValueError: a kernel has changed since, or its options have.
    """
    module = imported_module(module)
    _set_strip(module, strip_hash)
    kernels = _named_kernels(module)
    stem = _stem(module, kernels)
    folder = _folder(module_dir)
    for found in _devices(device):
        saved = _native.SavedModule(str(_find(folder, stem, found.arch, arch)))
        for native, name in kernels:
            saved.attach(native, name)
        module.saved.append(saved)


def _set_strip(module, strip_hash) -> None:
    if strip_hash is not None:
        module.options["strip_hash"] = bool(strip_hash)


def _folder(module_dir) -> Path:
    from pathlib import Path

    return Path(_native.cache_directory() if module_dir is None else os.fspath(module_dir))


def _named_kernels(module: Module) -> list:
    """Native kernels and the names they are saved under."""
    return [pair for key, kernel in sorted(module.kernels.items()) for pair in _named(kernel, key)]


def _warn_of_generic(module: Module) -> None:
    """Tells which generic kernels are left out, since nobody has said what they are for."""
    from warp._src.logger import notice

    left = [key for key, kernel in sorted(module.kernels.items()) if not _named(kernel, key)]
    if left:
        names = ", ".join(f"'{key}'" for key in left)
        notice(f"Warp UserWarning: generic kernels without overloads are not compiled: {names}")


def _named(kernel, key) -> list:
    if not kernel.is_generic:
        return [(kernel.prepare(), key)]
    return [(native, f"{key}_{tag}") for tag, native in kernel.tagged_specializations()]


def _adjoints(module: Module, enable_backward, gradients) -> list:
    """Native kernels of adjoints and the names they are saved under."""
    from warp._src.derivatives.saved import adjoints, wants_adjoints

    unknown = set(gradients) - set(module.kernels)
    if unknown:
        raise ValueError(f"module '{module.name}' has no kernel '{unknown.pop()}' for `gradients`")
    pairs = []
    for key, kernel in sorted(module.kernels.items()):
        wanted = gradients.get(key)
        if wanted is None and not wants_adjoints(kernel, enable_backward):
            continue
        for native, name in _named(kernel, key):
            pairs += adjoints(kernel, native, name, wanted)
    return pairs


def _stem(module: Module, kernels) -> str:
    import hashlib

    stem = f"wp_{module.name}"
    if module.options.get("strip_hash"):
        return stem
    text = "\n".join(name + native.ir("warp") for native, name in kernels)
    return f"{stem}_{hashlib.blake2b(text.encode(), digest_size=4).hexdigest()[:7]}"


def _target_name(architecture: int) -> str:
    return f"sm_{architecture}" if architecture else "cpu"


def _devices(device) -> list:
    several = isinstance(device, (list, tuple))
    return [get_device(one) for one in (device if several else [device])]


def _targets(device, arch, use_ptx):
    """(architecture, device number that makes machine code or -1) of each file to write."""
    targets = {}
    if arch is not None:
        for one in [arch] if isinstance(arch, int) else arch:
            if one not in _native.gpu_architectures():
                known = ", ".join(map(str, _native.gpu_architectures()))
                raise ValueError(f"no GPU architecture '{one}', there is: {known}")
            targets[one] = _assembler(one) if use_ptx is False else -1
    if device is not None or arch is None:
        for one in _devices(device):
            targets[one.arch] = -1 if use_ptx or one.is_cpu else one.index
    return list(targets.items())


def _assembler(arch: int) -> int:
    for device in get_cuda_devices():
        if device.arch == arch:
            return device.index
    raise RuntimeError(
        f"machine code for 'sm_{arch}' needs such a device, leave 'use_ptx' out to get PTX"
    )


def _find(folder: Path, stem: str, arch: int, wanted) -> Path:
    """The file for an architecture: its own, or that of the latest earlier one."""
    if arch == 0:
        names = ["cpu"]
    elif wanted is not None:
        names = [f"sm_{wanted}"]
    else:
        fitting = [one for one in _native.gpu_architectures() if one <= arch]
        names = [f"sm_{one}" for one in reversed(fitting)]
    tried = [folder / f"{stem}.{name}{_SUFFIX}" for name in names]
    for path in tried:
        if path.is_file():
            return path
    listed = ", ".join(f"'{path}'" for path in tried)
    raise FileNotFoundError(
        f"no saved module, tried {listed}; `compile_aot_module` writes it, and writes another name "
        f"when a kernel has changed"
    )
