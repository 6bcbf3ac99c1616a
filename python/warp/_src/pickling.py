"""Pickling: arrays, types, kernels and geometry that travel to other processes.

Classes of the package come here from `__reduce_ex__`, so that a program that pickles nothing does
not import this file. Types travel as a description and never as a class. A kernel travels by module
and name if these give the same object elsewhere; else by its source, its options and the values
that its text refers to, from which the copy has the same code and finds it in the kernel cache.
"""

from __future__ import annotations

import copyreg
import sys
import types

from warp._src.arrays import hooks
from warp._src.arrays.array import array
from warp._src.arrays.copies import clone
from warp._src.arrays.create import empty
from warp._src.arrays.indexed import IndexedRecord, record_class
from warp._src.devices import devices
from warp._src.kernels import declared, modules, texts
from warp._src.kernels.function import Function, NativeFunction
from warp._src.kernels.kernel import Kernel
from warp._src.types import dtypes
from warp._src.types.native import ArrayType, IndexedArrayType
from warp._src.types.structs import StructInstance, StructType, struct_from_fields

# Struct classes made from descriptions, by module, name and fields.
_structs: dict = {}


class Reference:
    """A value that unpickles to the result of `function(*arguments)`."""

    def __init__(self, function, *arguments):
        self.reduced = function, arguments

    def __reduce__(self):
        return self.reduced


def __getattr__(name):
    if name.startswith("__"):
        raise AttributeError(name)
    # Pickle looks for the functions of the version that wrote.
    import pickle

    from warp._src.version import VERSION

    raise pickle.UnpicklingError(
        f"warp {VERSION} does not know '{name}': load the pickle with the version that wrote it"
    )


# Types.


def type_reference(dtype):
    """A value that unpickles to a type; others are given back."""
    if isinstance(dtype, StructType):
        function, arguments = reduce_struct_class(dtype)
        return Reference(function, *arguments)
    return dtype


def reduce_struct_class(cls) -> tuple:
    """Describes a struct class by what makes it, or by its home and its fields."""
    if issubclass(cls, IndexedRecord) and cls is not IndexedRecord:
        annotation = cls._wp_annotation_
        return record_class, (type_reference(annotation.dtype), annotation.ndim)
    maker = cls.__dict__.get("_maker_")
    if maker is not None:
        return maker
    in_package = cls.__module__.partition(".")[0] == "warp"
    if in_package and _found(cls.__module__, cls.__qualname__) is cls:
        return named, (cls.__module__, cls.__qualname__)
    fields = tuple((name, type_reference(one)) for name, one in cls._wp_fields_.items())
    return struct_class, (cls.__module__, cls.__qualname__, cls.__name__, fields)


def struct_class(module, qualname, name, fields):
    """The struct class of a home, if it has these fields; else one made of them."""
    fields = dict(fields)
    found = _found(module, qualname)
    if isinstance(found, StructType) and _same_fields(found._wp_fields_, fields):
        return found
    key = module, qualname, tuple((one, dtypes.native_text(kind)) for one, kind in fields.items())
    if key not in _structs:
        _structs[key] = struct_from_fields(name, fields, module=module)
    return _structs[key]


def _same_fields(a, b) -> bool:
    return list(a) == list(b) and all(map(dtypes.types_equal, a.values(), b.values()))


def named(module, qualname):
    """The object of a name in a module, which is imported.

    Raises:
        pickle.UnpicklingError: there is no such module or name here.
    """
    from importlib import import_module as load

    try:
        found = load(module)
        for part in qualname.split("."):
            found = getattr(found, part)
    except (ImportError, AttributeError) as problem:
        import pickle

        raise pickle.UnpicklingError(
            f"cannot load '{qualname}' of module '{module}' here ({problem}): put the module on "
            "the path of this process"
        ) from None
    return found


def _found(module, qualname):
    """The object of a name in a module that this process has or can import, or None."""
    try:
        return named(module, qualname)
    except Exception:
        return None


# Arrays.


def holds_arrays(dtype) -> bool:
    """True if a struct, or one in it, has an array as a field."""
    return any(
        isinstance(one, ArrayType) or (dtypes.is_struct(one) and holds_arrays(one))
        for one in dtype._wp_fields_.values()
    )


def reduce_array(value, protocol) -> tuple:
    """An array as its bytes, which travel out of band where the pickler can do that.

    Raises:
        TypeError: its elements hold arrays.
    """
    import pickle

    import numpy

    dtype = value.dtype
    if dtypes.is_struct(dtype) and holds_arrays(dtype):
        raise TypeError(
            f"cannot pickle an array of '{dtype.__name__}', whose elements hold arrays: pickle "
            "these arrays, and make the elements where they are loaded"
        )
    data = numpy.ascontiguousarray(value.numpy()).view(numpy.ndarray)
    data = data.reshape(-1).view(numpy.uint8)
    contents = pickle.PickleBuffer(data) if protocol >= 5 and value.size else bytearray(data)
    grad = value.grad if value.grad_in_use is not None else None
    arguments = (
        type_reference(dtype),
        tuple(value.shape),
        contents,
        str(value.device),
        value.requires_grad,
        grad,
        (value.read_only, value.pinned, value.retain_grad),
    )
    return load_array, arguments


def load_array(dtype, shape, contents, device, requires_grad, grad, flags):
    """An array of pickled bytes, over them if they are to be on the CPU."""
    import numpy

    read_only, pinned, retain_grad = flags
    there = devices.get_device(devices.present(device))
    if not len(memoryview(contents)):
        made = empty(shape, dtype=dtype, device=there)
    else:
        size = dtypes.type_size_in_bytes(dtype)
        data = numpy.frombuffer(contents, numpy.uint8)
        lent = array(data, dtype=dtypes.uint8, device="cpu", copy=False)
        strides, step = [], size
        for extent in reversed(shape):
            strides.insert(0, step)
            step *= extent
        made = lent._view(0, tuple(shape), tuple(strides), dtype)
        if read_only and not made.read_only:
            made._protect()
        if pinned and devices.is_cuda_available():
            made = clone(made, device="cpu", pinned=True)
        elif there.is_cuda:
            made = clone(made, device=there)
    if grad is not None:
        made.grad = grad
    elif requires_grad:
        made.requires_grad = True
    if retain_grad:
        made.retain_grad = True
    return made


def reduce_struct(value) -> tuple:
    """A struct instance as its class and its fields."""
    fields = {name: getattr(value, name) for name in value._wp_fields_}
    own = {name: one for name, one in vars(value).items() if not name.startswith("_objects_")}
    return load_struct, (type_reference(type(value)), fields, own)


def load_struct(cls, fields, own):
    """A struct instance with these fields and attributes."""
    value = cls()
    vars(value).update(own)
    for name, one in fields.items():
        StructInstance.__setattr__(value, name, one)
    return value


# Kernels and functions.


def _reduce_declared(one, state) -> tuple:
    """A kernel or function by name, or by `state(one)` where the name gives something else."""
    module, qualname = one.__module__, one.__qualname__
    if module != "__main__" and "<" not in qualname and _found(module, qualname) is one:
        return named, (module, qualname)
    lines = texts.block_of(one.func).lines
    made = blank, (type(one), module, qualname, lines)
    return *made, state(one), None, None, restore


def blank(cls, module, qualname, lines):
    """The kernel or function of a name if it has this text; else one that gets its state next."""
    found = _found(module, qualname) if module in sys.modules else None
    if type(found) is cls and texts.block_of(found.func).lines == lines:
        return found
    return cls.__new__(cls)


def kernel_state(kernel) -> dict:
    """The parts that a kernel is made of."""
    module = kernel.module
    own = module.name != kernel.func.__module__
    return {
        "func": packed(kernel.func),
        "key": kernel.key,
        "module": module.name,
        "unique": own and kernel.unique_key is not None,
        "module_options": dict(module.options),
        "options": dict(kernel.options),
    }


def set_kernel_state(kernel, state) -> None:
    """Makes a blank kernel what the state says."""
    func = unpacked(state["func"])
    if state["unique"]:
        module = modules.make_unique(func.__module__, func.__name__, id(kernel))
    else:
        known = state["module"] in modules.modules_by_name
        module = modules.get_module(state["module"])
        if known and module.kernels and dict(module.options) != state["module_options"]:
            # Kernels here have other options.
            module = modules.make_unique(func.__module__, func.__name__, id(kernel))
    module.options.update(state["module_options"])
    kernel.__init__(func, state["key"], module, state["options"])


def function_state(function) -> dict:
    """The parts that a function of kernels is made of."""
    own = {name: vars(function)[name] for name in vars(function) if name.endswith("snippet")}
    kept = ("pullback", "pushforward")
    given = {name: vars(function)[name] for name in kept if name in vars(function)}
    return {
        "overloads": [packed(one) for one in function.overloads],
        "key": function.key,
        "pullbacks": [_packed_or_same(one) for one in function.pullbacks],
        "replays": [_packed_or_same(one) for one in function.replays],
        "own": own | given,
    }


def set_function_state(function, state) -> None:
    """Makes a blank function of kernels what the state says."""
    first, *others = map(unpacked, state["overloads"])
    Function.__init__(function, first, state["key"])
    function.overloads += others
    function.pullbacks = [_unpacked_or_same(one) for one in state["pullbacks"]]
    function.replays = [_unpacked_or_same(one) for one in state["replays"]]
    vars(function).update(state["own"])


def _packed_or_same(value):
    return Packed(packed(value)) if isinstance(value, types.FunctionType) else value


def _unpacked_or_same(value):
    return unpacked(value.state) if isinstance(value, Packed) else value


class Packed:
    """A Python function that travels by its source."""

    def __init__(self, state):
        self.state = state


def packed(func) -> dict:
    """A Python function as text and the values that the text refers to."""
    import ast

    from warp._src.frontend.source import source_of

    source = source_of(func)
    if texts.is_made(func):
        text, first = ast.unparse(source.tree) + "\n", 1
    else:
        text, first = texts.block_of(func).text, func.__code__.co_firstlineno
    used = {node.id for node in ast.walk(source.tree) if isinstance(node, ast.Name)}
    space = declared.names_of(func)
    return {
        "name": func.__name__,
        "qualname": func.__qualname__,
        "module": func.__module__,
        "text": text,
        "first": first,
        "names": {name: _value(space[name]) for name in sorted(used & space.keys())},
        "annotations": {name: _value(one) for name, one in func.__annotations__.items()},
        "defaults": func.__defaults__,
        "kwdefaults": func.__kwdefaults__,
        "statics": declared._values(func),
    }


def _value(value):
    if isinstance(value, types.ModuleType):
        return Reference(__import__, value.__name__, None, None, [""])
    return type_reference(value)


def unpacked(state):
    """A Python function of what `packed` gave."""
    import ast
    import linecache
    from _blake2 import blake2b

    from warp._src.kernels import made_functions

    text, first = state["text"], state["first"]
    lines = text.splitlines(keepends=True)
    indented = text[:1].isspace()
    tree = ast.parse("if 1:\n" + text).body[0].body[0] if indented else ast.parse(text).body[0]
    ast.increment_lineno(tree, first - 1 - indented)
    tree.decorator_list = []
    digest = blake2b(text.encode("utf-8", "surrogatepass"), digest_size=8).hexdigest()
    file = f"<{state['name']} {digest}>"
    shown = ["\n"] * (first - 1) + lines
    linecache.cache[file] = (len(text), None, shown, file)
    cells = {name: types.CellType(value) for name, value in state["names"].items()}
    free = tuple(sorted(cells))
    code, _ = made_functions._compiled(tree, file, free, lines, evaluated=False)
    space = {"__name__": state["module"], "__builtins__": __builtins__}
    closure = tuple(cells[name] for name in code.co_freevars)
    made = types.FunctionType(code, space, state["name"], state["defaults"], closure)
    made.__kwdefaults__ = state["kwdefaults"]
    made.__module__, made.__qualname__ = state["module"], state["qualname"]
    made.__annotations__ = state["annotations"]
    made.__dict__[declared._NAME] = code, state["statics"]
    return made


def restore(declared, state) -> None:
    """Makes a blank kernel or function what the state says; a complete one stays as it is."""
    if "func" not in vars(declared):
        setting = set_kernel_state if isinstance(declared, Kernel) else set_function_state
        setting(declared, state)


def _reduce_kernel(kernel) -> tuple:
    return _reduce_declared(kernel, kernel_state)


def _reduce_function(function) -> tuple:
    return _reduce_declared(function, function_state)


def _reduce_annotation(value) -> tuple:
    own = {name: one for name, one in vars(value).items() if name not in ("dtype", "ndim")}
    return type(value), (type_reference(value.dtype), value.ndim), own or None


hooks.reduce_array = reduce_array
StructType.reduce_instance = staticmethod(reduce_struct)
copyreg.pickle(StructType, reduce_struct_class)
copyreg.pickle(Kernel, _reduce_kernel)
copyreg.pickle(Function, _reduce_function)
copyreg.pickle(NativeFunction, _reduce_function)
copyreg.pickle(ArrayType, _reduce_annotation)
copyreg.pickle(IndexedArrayType, _reduce_annotation)
