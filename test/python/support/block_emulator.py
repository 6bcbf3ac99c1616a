"""Runs the code that a block of a GPU would run, thread by thread, in Python.

The text of `kernel.ir("thread", arch=90)` becomes a Python generator per thread that stops at each
barrier. Between two barriers threads run one after the other, in an order that the caller chooses:
code that misses a barrier gives another result in some order. Slow; for kernels with small tiles
whose barriers are all threads', and of the operations that occur there.
"""

import re
import struct

import numpy as np

_FLOATS = {"f16": np.float16, "f32": np.float32, "f64": np.float64}
_COMPARE = {"eq": "==", "ne": "!=", "lt": "<", "le": "<=", "gt": ">", "ge": ">="}
_BINARY = {
    "arith.addi": "+", "arith.subi": "-", "arith.muli": "*", "arith.andi": "&", "arith.ori": "|",
    "arith.xori": "^", "arith.addf": "+", "arith.subf": "-", "arith.mulf": "*", "arith.divf": "/",
    "arith.shrsi": ">>", "arith.shrui": ">>", "arith.divui": "//",
    "arith.remui": "%",
}  # fmt: skip


def wrap(value, type):
    """An integer of a number of bits, with a sign; a float rounded."""
    if type in _FLOATS:
        return _FLOATS[type](value)
    bits = int(type[1:])
    value = int(value) & ((1 << bits) - 1)
    return value - (1 << bits) if bits > 1 and value >> (bits - 1) else value


def unsigned(value, type):
    return int(value) & ((1 << int(type[1:])) - 1)


def rebits(value, source, target):
    letters = {"f16": "e", "f32": "f", "f64": "d", "i16": "h", "i32": "i", "i64": "q"}
    return struct.unpack(letters[target], struct.pack(letters[source], value))[0]


class Memory:
    """An array of a kernel, or one at a place in shared memory."""

    def __init__(self, data):
        self.data = data

    def load(self, *index):
        found = self.data[index]
        if getattr(found, "ndim", 0):
            return tuple(found)
        if self.data.dtype.kind == "u":
            return wrap(found, f"i{8 * self.data.itemsize}")
        return found.item()

    def store(self, values, *index):
        if self.data.dtype.kind == "u":
            values = [unsigned(one, f"i{8 * self.data.itemsize}") for one in values]
        self.data[index] = values if len(values) > 1 else values[0]

    def view(self, *index):
        return Memory(self.data[index])

    def component(self, place):
        return Memory(self.data[..., place])

    def add(self, values, *index):
        old = self.load(*index)
        self.store([old + values[0]], *index)
        return old

    def sub(self, values, *index):
        return self.add([-values[0]], *index)


def element_type(type):
    """NumPy's type and components of an element."""
    vector = re.match(r"!warp\.vec<(\d+) x (\w+)>", type)
    count, scalar = (int(vector[1]), vector[2]) if vector else (1, type)
    names = {"f": "float", "i": "int", "s": "int", "u": "uint"}
    kind, bits = re.match(r"([a-z])\D*(\d+)", scalar).groups()
    return np.dtype(names[kind] + bits), count


def name_of(value):
    value = value.strip()
    return "v_" + re.sub(r"\W", "_", value[1:]) if value.startswith("%") else value


def _expression(op, rest):
    """Python for what follows the name of an operation with one result."""
    body, _, types = rest.rpartition(" : ")
    body = re.sub(r" (overflow|fastmath)<[^>]*>", "", body)
    args = [name_of(one) for one in body.split(",")]
    if op == "arith.constant":
        value, _, type = rest.partition(" : ")
        if value in ("true", "false"):
            return value.title()
        if value.startswith("0x") and type in _FLOATS:
            return f"rebits({value}, 'i{type[1:]}', '{type}')"
        return f"wrap({value}, '{type}')"
    if op == "arith.remsi":
        return f"wrap(np.fmod({args[0]}, {args[1]}), '{types}')"
    if op == "arith.divsi":
        return f"wrap(np.trunc({args[0]} / {args[1]}), '{types}')"
    if op in _BINARY:
        if op in ("arith.shrui", "arith.divui", "arith.remui"):
            args = [f"unsigned({one}, '{types}')" for one in args]
        return f"wrap({args[0]} {_BINARY[op]} {args[1]}, '{types}')"
    if op in ("arith.cmpi", "arith.cmpf"):
        kind = args[0].removeprefix("s").removeprefix("u") if op == "arith.cmpi" else args[0][1:]
        given = args[1:]
        if op == "arith.cmpi" and args[0][0] == "u":
            given = [f"unsigned({one}, '{types}')" for one in given]
        test = f"({given[0]} {_COMPARE[kind]} {given[1]})"
        is_unordered = op == "arith.cmpf" and args[0][0] == "u"
        return f"({test} or {given[0]} != {given[0]})" if is_unordered else test
    if op == "arith.select":
        return f"({args[1]} if {args[0]} else {args[2]})"
    if op in ("arith.minsi", "arith.maxsi"):
        return f"{op[6:9]}({args[0]}, {args[1]})"
    if op in ("arith.minnumf", "arith.maxnumf"):
        return f"wrap(np.f{op[6:9]}({args[0]}, {args[1]}), '{types}')"
    if op in ("math.sin", "math.cos", "math.sqrt"):
        return f"wrap(np.{op[5:]}({args[0]}), '{types}')"
    if op == "arith.negf":
        return f"wrap(-{args[0]}, '{types}')"
    source, _, target = types.partition(" to ")
    if op == "arith.bitcast":
        return f"rebits({args[0]}, '{source}', '{target}')"
    if op == "arith.extui":
        return f"unsigned({args[0]}, '{source}')"
    return f"wrap({args[0]}, '{target}')"


def _access(call, text):
    """Python for what changes an element: values in brackets, an array and its indices."""
    values, array, index = re.match(r"\(([^)]*)\), (%\w+)\[([^\]]*)\]", text).groups()
    given = "".join(name_of(one) + ", " for one in values.split(","))
    at = ", ".join(name_of(one) for one in index.split(","))
    return f"{name_of(array)}.{call}(({given}), {at})"


def _slot(text):
    """Python for an element of memory of a thread alone."""
    array, index = re.search(r"(%\w+)\[(%\w+)\]", text).groups()
    return f"{name_of(array)}[{name_of(index)}]"


def statement(line):
    """Python for one line of IR, and what it opens."""
    if line == "warp.barrier":
        return "yield"
    if line.startswith("warp.store_components"):
        return _access("store", line.removeprefix("warp.store_components"))
    if line.startswith("warp.scratch_store"):
        return f"{_slot(line)} = {name_of(line.split()[1].rstrip(','))}"
    result, _, rest = line.partition(" = ")
    op, _, rest = rest.partition(" ")
    name = name_of(result.partition(":")[0])
    if op == "warp.thread_number":
        return f"{name} = thread"
    if op == "warp.tid":
        count = result.partition(":")[2]
        names = [f"{name}_{i}" for i in range(int(count))] if count else [name]
        return f"{', '.join(names)}, *_ = tid(thread)"
    if op == "warp.scratch":
        # Nothing until it is written.
        return f"{name} = [None] * {re.search(r'scratch<([0-9]+)', rest)[1]}"
    if op == "warp.scratch_load":
        return f"{name} = {_slot(rest)}"
    if op == "warp.launch_extent":
        return f"{name} = dim[{rest.split()[0]}]"
    if op == "warp.atomic_components":
        kind = rest.partition("(")[0].strip()
        return f"{name} = {_access(kind, rest.removeprefix(kind).strip())}"
    if op == "warp.block_memory":
        return f"{name} = {rest.split()[0]}"
    if op == "warp.array_at":
        place, count, type = re.match(
            r"(%\w+)\[(%\w+)\] : .*!warp\.array<1 x (.*)>$", rest
        ).groups()
        return f"{name} = block({name_of(place)}, {name_of(count)}, {type!r})"
    if op == "warp.component_view":
        array, place = re.match(r"(%\w+)\[([^\]]*)\]", rest).groups()
        return f"{name} = {name_of(array)}.component({name_of(place)})"
    if op == "warp.view":
        array, index = re.match(r"(%\w+)\[([^\]]*)\]", rest).groups()
        at = ", ".join(name_of(one) for one in index.split(","))
        return f"{name} = {name_of(array)}.view({at})"
    if "llvm.fptosi.sat" in rest:
        return f"{name} = int({name_of(re.search(r'[(](%[^)]*)[)]', rest)[1])})"
    if op == "warp.dim":
        array, axis = re.match(r"(%\w+), (\d+)", rest).groups()
        return f"{name} = {name_of(array)}.data.shape[{axis}]"
    if op == "warp.load_components":
        array, index = re.match(r"(%\w+)\[([^\]]*)\]", rest).groups()
        at = ", ".join(name_of(one) for one in index.split(","))
        parts = result.partition(":")[2]
        names = ", ".join(f"{name}_{i}" for i in range(int(parts))) if parts else name
        return f"{names} = {name_of(array)}.load({at})"
    return f"{name} = {_expression(op, rest)}"
