"""Functions that users wrote in C++: compiled by Clang, linked into kernels on CPUs.

The text is the body of a function of the parameters' names and types. Nothing here looks into it:
Clang, where it is installed, makes bitcode of it when a kernel calls the function first.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import shutil
import subprocess
import tempfile

from warp import _native
from warp._src import errors
from warp._src.kernels.native_header import ARRAYS, NUMBERS

# By the text of the native type: what C++ calls it.
SCALARS = {
    "i1": "bool",
    "si8": "int8_t",
    "ui8": "uint8_t",
    "si16": "int16_t",
    "ui16": "uint16_t",
    "si32": "int32_t",
    "ui32": "uint32_t",
    "si64": "int64_t",
    "ui64": "uint64_t",
    "f32": "float",
    "f64": "double",
}
_known: dict = {}


@functools.cache
def compiler() -> str | None:
    """Path of Clang: what WARP_CLANG says, or one that is installed."""
    named = os.environ.get("WARP_CLANG")
    return shutil.which(named) if named else shutil.which("clang-22") or shutil.which("clang")


def add(name, body, parameters, result) -> str:
    """Compiles a function and makes it known to kernels; its symbol.

    Args:
        name: of the function, for messages.
        body: C++ text.
        parameters: (name, native type) of each.
        result: native type.

    Raises:
        WarpCompileError: there is no Clang, or it refuses the text; its words follow.
    """
    declared = ", ".join(f"{SCALARS[native]} {parameter}" for parameter, native in parameters)
    passed = ", ".join(parameter for parameter, _ in parameters)
    text = (
        f'{NUMBERS}static inline {SCALARS[result]} warp_function({declared}) {{\n#line 1 "{name}"\n'
        f"{body}\n}}\n"
    )
    symbol = "warp_native_" + hashlib.sha256(text.encode()).hexdigest()[:24]
    if symbol not in _known:
        separator = ", " if parameters else ""
        text += (
            f'extern "C" void {symbol}({declared}{separator}{SCALARS[result]} *warp_out) '
            f"{{ *warp_out = warp_function({passed}); }}\n"
        )
        _native.add_native_code(symbol, _bitcode(name, text))
        _known[symbol] = name
    return symbol


_COMPOSITE = re.compile(r"!warp\.(\w+)<(?:([\dx ]+) x )?(\w+)>")


def element_name(native) -> str | None:
    """What C++ calls elements of an array by the text of their native type; None if nothing."""
    found = _COMPOSITE.fullmatch(native)
    if found is None:
        return SCALARS.get(native)
    kind, extents, scalar = found.groups()
    if scalar not in SCALARS or kind not in ("vec", "mat", "quat", "transform"):
        return None
    numbers = [*re.findall(r"\d+", extents or ""), SCALARS[scalar]]
    return f"wp::{kind}_t<{', '.join(numbers)}>"


def add_memory(code, parameters) -> str:
    """Compiles a function with arrays (`native_arrays.MemoryCode`); its symbol.

    Args:
        code: its text is a block in braces that returns the one result, or all in braces.
        parameters: (name, native type, 0) of each number, (name, type of elements, rank) of each
            array.

    Raises:
        WarpCompileError: as for `add`.
    """
    fields = "".join(f"{SCALARS[one]} r{i}; " for i, one in enumerate(code.results))
    results = f"struct Results {{ {fields or 'int32_t r0;'} }};\n"
    declared, passed, outer = [], [], []
    for name, native, rank in parameters:
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
        f"{NUMBERS}{ARRAYS}{results}static inline {returned} warp_function({', '.join(declared)}) "
        f"{code.native_snippet}\n"
    )
    symbol = "warp_native_memory_" + hashlib.sha256(text.encode()).hexdigest()[:24]
    if symbol not in _known:
        text += (
            f'extern "C" void {symbol}({", ".join([*outer, "Results *warp_out"])}) '
            f"{{ *warp_out = Results({kept}); }}\n"
        )
        _native.add_native_code(symbol, _bitcode(code.key, text))
        _known[symbol] = code.key
    return symbol


def _bitcode(name, text) -> bytes:
    clang = compiler()
    if clang is None:
        raise errors.WarpCompileError(
            f"the native code of '{name}' needs Clang: install it, name it in WARP_CLANG, or write "
            "the function in Python with `@wp.func`"
        )
    with tempfile.TemporaryDirectory() as folder:
        source, made = os.path.join(folder, "native.cpp"), os.path.join(folder, "native.bc")
        with open(source, "w", encoding="utf-8") as file:
            file.write(text)
        command = [clang, "-x", "c++", "-std=c++17", "-O2", "-ffp-contract=off", "-fno-exceptions"]
        command += ["-emit-llvm", "-c", source, "-o", made]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise errors.WarpCompileError(
                f"Clang refuses the native code of '{name}':\n{done.stderr.strip()}"
            )
        with open(made, "rb") as file:
            return file.read()
