"""Functions that users wrote in C++: their text, made whole for the compilers.

The user's text is the body of a function of the parameters' names and types. Nothing here looks
into it but for the words of `_TOGETHER`: Clang makes bitcode of it when a kernel that calls it is
compiled for a CPU, NVRTC makes PTX for a GPU.
"""

from __future__ import annotations

import functools
import hashlib
import re
import sys
from pathlib import Path

from warp import _native
from warp._src.kernels.native_header import header
from warp._src.kernels.native_structs import SCALARS, element_name, scalar_name

_known: dict = {}


# Words of code that threads do together or that is no function of its arguments: such calls stay
# where they stand, and the threads of a block are those of the launch.
_TOGETHER = re.compile(r"sync|atomic|__shfl|__ballot|__any|__all|threadIdx|blockIdx|clock|asm")


_ATOMIC = re.compile(r"atomic|__sync_|__atomic_")


def _prefix(snippet, memory: bool) -> str:
    """The prefix of names of pieces of code, as include/warp/NativeCode.h has it."""
    if not memory:
        return "warp_native_"
    return f"warp_native_memory_{'turn_' if _ATOMIC.search(snippet) else ''}"


def is_together(snippet) -> bool:
    """True if the text may be one that the threads of a block do together."""
    return _TOGETHER.search(snippet) is not None


def compiler(gpu=False) -> str:
    """Clang or NVRTC for GPUs, as WARP_CLANG or WARP_NVRTC say or as it is installed; or ""."""
    _tell_folders()
    return _native.native_compiler(gpu)


@functools.cache
def _tell_folders():
    """NVRTC as packages of Python bring it."""
    folders = [
        folder
        for path in sys.path
        for pattern in ("nvidia/cu1*/lib", "nvidia/cuda_nvrtc/lib")
        for folder in sorted(Path(path or ".").glob(pattern), reverse=True)
    ]
    _native.set_nvrtc_folders([*map(str, folders)])


def place_of(context, node) -> str:
    """A compiler's message about a call, with '%' in the place of its words."""
    problem = context.error(node, "%")
    problem.notes = context.session.notes_of_calls()
    return str(problem)


def add(name, body, parameters, result, place, build) -> str:
    """Makes a function of numbers known to kernels; its symbol.

    Args:
        name: of the function, for messages.
        body: C++ text.
        parameters: (name, native type) of each.
        result: native type, None for nothing.
        place: what `place_of` says.
        build: what the kernel's module adds, a `Build`.
    """
    declared = ", ".join(f"{SCALARS[native]} {parameter}" for parameter, native in parameters)
    passed = ", ".join(parameter for parameter, _ in parameters)
    returned = SCALARS[result] if result else "void"
    text = (
        f"{header(body)}{build.text}static inline {returned} warp_function({declared}) "
        f'{{\n#line 1 "{name}"\n{body}\n}}\n'
    )
    separator = ", " if parameters else ""
    prefix = _prefix(body, is_together(body) or not result)
    kept = f"*warp_out = {'' if result else '0; '}warp_function({passed});"
    out = f"{declared}{separator}{returned if result else 'int32_t'} *warp_out"
    return _add(prefix, name, text, out, kept, place, build)


def _add(prefix, name, text, parameters, body, place, build) -> str:
    mark = hashlib.sha256(text.encode()).hexdigest()[:24]
    symbol = prefix + mark
    if symbol not in _known:
        _tell_folders()
        # The names of different functions of users may not meet in the code of a kernel.
        whole = f"#define warp_function warp_function_{mark}\n{text}"
        whole += f'extern "C" void {symbol}({parameters}) {{ {body} }}\n'
        folders = build.cpu_folders, build.gpu_folders
        _native.add_native_code(symbol, name, whole, place, *folders)
        _known[symbol] = name
    return symbol


def add_memory(code, parameters, place, build) -> str:
    """Makes known a function with arrays (`native_arrays.MemoryCode`); its symbol.

    Args:
        code: its text is a block in braces that returns the one result, or all in braces.
        parameters: (name, native type, 0) of each number, (name, type of elements, rank) of each
            array, (name, native type, minus its numbers) of each vector, matrix, quaternion or
            transform.
        place, build: as for `add`.
    """
    fields = "".join(f"{SCALARS[one]} r{i}; " for i, one in enumerate(code.results))
    results = f"struct Results {{ {fields or 'int32_t r0;'} }};\n"
    declared, passed, outer = [], [], []
    for name, native, rank in parameters:
        if rank < 0:
            kind, scalar = element_name(native), scalar_name(native)
            parts = [f"{name}_{i}" for i in range(-rank)]
            declared.append(f"{kind} {name}")
            outer += [f"{scalar} {one}" for one in parts]
            passed.append(f"warp_native::made_of<{kind}, {scalar}>({', '.join(parts)})")
            continue
        if not rank:
            declared.append(f"{SCALARS[native]} {name}")
            outer.append(declared[-1])
            passed.append(name)
            continue
        element = element_name(native)
        declared.append(f"wp::array_t<{element}> {name}")
        extents = [f"{name}_d{axis}" for axis in range(rank)]
        strides = [f"{name}_s{axis}" for axis in range(rank)]
        outer += [f"uint64_t {name}_p", *(f"int32_t {one}" for one in [*extents, *strides])]
        padded = [*extents, *["1"] * (4 - rank)]
        made = (
            f"wp::array_t<{element}>{{({element} *){name}_p, nullptr, {{{{{', '.join(padded)}}}}}, "
            f"{{{', '.join(strides)}}}, {rank}, 0}}"
        )
        like = code.likes.get(name)
        if like is not None:
            at = [one for one, _, _ in parameters].index(like)
            made = f"warp_native::Gradients<{element}>({made}, {passed[at]}).array"
        passed.append(made)
    one = SCALARS[code.results[0]] if len(code.results) == 1 and not code.likes else None
    returned = one or ("Results" if code.results else "void")
    called = f"warp_function({', '.join(passed)})"
    kept = f"{{{called}}}" if one else called if code.results else f"({called}, Results{{0}})"
    text = (
        f"{header(code.native_snippet, arrays=True)}{code.structs}{build.text}{results}"
        f"static inline {returned} warp_function({', '.join(declared)}) {code.native_snippet}\n"
    )
    out = ", ".join([*outer, "Results *warp_out"])
    body = f"*warp_out = Results({kept});"
    return _add(_prefix(code.native_snippet, True), code.key, text, out, body, place, build)
