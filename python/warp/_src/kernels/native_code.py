"""Functions that users wrote in C++: compiled by Clang, linked into kernels on CPUs.

The text is the body of a function of the parameters' names and types. Nothing here looks into it:
Clang, where it is installed, makes bitcode of it when a kernel calls the function first.
"""

from __future__ import annotations

import functools
import hashlib
import os
import shutil
import subprocess
import tempfile

from warp import _native
from warp._src import errors

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
_HEADER = """#include <math.h>
#include <stdint.h>
#include <string.h>
namespace wp {
typedef int8_t int8; typedef uint8_t uint8; typedef int16_t int16; typedef uint16_t uint16;
typedef int32_t int32; typedef uint32_t uint32; typedef int64_t int64; typedef uint64_t uint64;
typedef float float32; typedef double float64;
}
using namespace wp;
"""
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
        f'{_HEADER}static inline {SCALARS[result]} warp_function({declared}) {{\n#line 1 "{name}"\n'
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
