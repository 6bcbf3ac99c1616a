"""Kernels and their derivatives as text, at each stage of compilation."""

from __future__ import annotations

import os

from warp import _native, config
from warp._src.derivatives.derivative import differentiate
from warp._src.devices.devices import get_device

STAGES = ("warp", "thread", "launch", "gpu", "llvm", "ptx", "asm")
DERIVATIVES = ("adjoint", "tangent")
_SUFFIX = {"llvm": "ll", "ptx": "ptx", "asm": "s"}
# The architecture of shown code for GPUs where no device is named: the newest one with a
# stable ISA.
DEFAULT_GPU = 90


def text_of(kernel, stage, device, rank, arch, derivative, inputs) -> str:
    """The result of `Kernel.ir`; its arguments."""
    if stage in DERIVATIVES:
        stage, derivative = "warp", stage
    if derivative is not None:
        return _derivative_text(kernel, stage, device, rank, arch, derivative, inputs)
    _check_stage(stage, STAGES + DERIVATIVES)
    if arch is None:
        arch = _architecture(stage, device)
    elif stage == "asm" or arch not in _native.gpu_architectures():
        raise ValueError(f"there is no stage {stage!r} for architecture {arch!r}")
    native = kernel.prepare()
    return kernel.code_for(native, arch).ir(stage, arch, rank or 0)


def _derivative_text(kernel, stage, device, rank, arch, derivative, inputs) -> str:
    """The text of a derivative; it is made for this alone."""
    if derivative not in DERIVATIVES:
        raise ValueError(f"no derivative {derivative!r}, expects 'adjoint' or 'tangent'")
    _check_stage(stage, STAGES)
    if arch is None:
        arch = _architecture(stage, device)
    native = kernel.prepare()
    active = ()
    if inputs is not None:
        arrays = [name for name, kind, *_ in native.parameters if kind == "array"]
        unknown = sorted(set(inputs) - set(arrays))
        if unknown:
            known = ", ".join(map(repr, arrays))
            raise ValueError(f"no array {unknown[0]!r} in '{kernel.key}'; there are {known}")
        active = [name in inputs for name in arrays]
    forward = derivative == "tangent"
    # Tiles have another form for blocks of many threads.
    native = kernel.code_for(native, arch)
    made = differentiate(native, active, forward, tape=kernel.option("tape"))
    if stage == "warp":
        return made.module.text()
    return kernel.compile_module(made.module).ir(stage, arch, rank or 0)


def _check_stage(stage, known) -> None:
    if stage not in STAGES:
        raise ValueError(f"no stage {stage!r}, expects one of {', '.join(map(repr, known))}")


def _architecture(stage, device) -> int:
    if stage == "asm":
        return 0
    if device is not None:
        arch = get_device(device).arch
        if arch or stage not in ("gpu", "ptx"):
            return arch
    return DEFAULT_GPU if stage in ("gpu", "ptx") else 0


def dump(kernel, native) -> None:
    """Writes a file for each stage to the folder `wp.config.dump`, if that is set."""
    if not config.dump:
        return
    os.makedirs(config.dump, exist_ok=True)
    for stage in STAGES:
        text = native.ir(stage, _architecture(stage, None))
        path = os.path.join(config.dump, f"{kernel.key}.{stage}.{_SUFFIX.get(stage, 'mlir')}")
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)
