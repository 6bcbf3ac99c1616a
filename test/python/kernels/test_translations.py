"""Translations from the cache: found without the front end, and never for another kernel.

One program holds a kernel for each thing that code can depend on. It runs with one of them changed,
beside the cache that the unchanged program has left: that kernel has to be translated again and to
give its new value, all others have to come from the cache with their old ones.
"""

import json
from pathlib import Path

import pytest

import programs

PROGRAM = """
import enum, json, os, sys, types
from typing import Any
import numpy as np
import warp as wp
from warp._src.kernels import translations
wp.config.quiet = True
translated, results = [], {}
original = translations._translated
def noted(kernel, *rest):
    translated.append(kernel.key)
    return original(kernel, *rest)
translations._translated = noted

def run(kernel, *inputs):
    x = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(kernel, 1, [x, *inputs], device="cpu")
    results[kernel.key] = float(x.numpy()[0])

@wp.kernel
def own_text(x: wp.array(dtype=float)):
    x[0] = 1.5  # own text
run(own_text)

@wp.func
def deepest(a: float):
    return a + 2.5  # deepest
@wp.func
def middle(a: float):
    return 2.0 * deepest(a)
@wp.kernel
def text_of_functions(x: wp.array(dtype=float)):
    x[0] = middle(1.0)
run(text_of_functions)

NUMBER = 3.5  # global
@wp.kernel
def global_number(x: wp.array(dtype=float)):
    x[0] = NUMBER
run(global_number)

def make(captured):
    @wp.kernel
    def closure(x: wp.array(dtype=float)):
        x[0] = captured
    return closure
run(make(4.5))  # closure

VECTOR = wp.vec3(1.0, 2.0, 5.5)  # vector
@wp.kernel
def global_vector(x: wp.array(dtype=float)):
    x[0] = VECTOR[2]
run(global_vector)

constants = types.ModuleType("constants")
constants.inner = types.ModuleType("constants.inner")
constants.inner.VALUE = 6.5  # module
@wp.kernel
def attribute_of_module(x: wp.array(dtype=float)):
    x[0] = constants.inner.VALUE
run(attribute_of_module)

class Base:
    VALUE = 7.5  # base class
class Derived(Base):
    OTHER = 1.0
@wp.kernel
def inherited_attribute(x: wp.array(dtype=float)):
    x[0] = Derived.VALUE * Derived.OTHER
run(inherited_attribute)

class Kind(enum.IntEnum):
    FIRST = 8  # int enum
class Named(enum.Enum):
    FIRST = 9.5  # enum
@wp.kernel
def int_enum(x: wp.array(dtype=float)):
    x[0] = float(Kind.FIRST)
run(int_enum)
@wp.kernel
def value_of_enum(x: wp.array(dtype=float)):
    x[0] = Named.FIRST.value
run(value_of_enum)

@wp.struct
class Pair:
    first: float
    second: int  # struct
@wp.kernel
def struct_layout(x: wp.array(dtype=float), pair: Pair):
    x[0] = pair.first + float(pair.second / type(pair.second)(2))
pair = Pair()
pair.first, pair.second = 10.5, 3  # fields
run(struct_layout, pair)

@wp.kernel
def generic_argument(x: wp.array(dtype=float), value: Any):
    x[0] = float(value / type(value)(2))
run(generic_argument, wp.float64(11.0))  # generic

STATE = [12.5]  # state
def compute():
    return STATE[0]
@wp.kernel
def static_call(x: wp.array(dtype=float)):
    x[0] = wp.static(compute())
run(static_call)

TABLE = {0: 1.5, 1: 12.0}  # table
@wp.kernel
def static_of_counter(x: wp.array(dtype=float)):
    for i in range(2):
        x[0] = x[0] + wp.static(TABLE[i])
run(static_of_counter)

@wp.func
def with_default(a: float, b: float = 13.5):  # default
    return a * b
@wp.kernel
def default_argument(x: wp.array(dtype=float)):
    x[0] = with_default(1.0)
run(default_argument)

Alias = float  # alias
@wp.func
def annotated(a: "Alias", b: Any):
    return b
@wp.func
def annotated(a: int, b: Any):
    return b + 1.0
@wp.kernel
def annotation(x: wp.array(dtype=float)):
    x[0] = annotated(1, 14.5)
run(annotation)

@wp.func
def add_up(a: float, b: float):
    return a + b
@wp.func
def multiply(a: float, b: float):
    return a * b
def combine(operation):
    @wp.kernel
    def captured_function(x: wp.array(dtype=float)):
        x[0] = operation(3.0, 4.0)
    return captured_function
run(combine(add_up))  # operation

TUPLE = (1.0, (15.5, 2))  # tuple
@wp.kernel
def tuple_of_numbers(x: wp.array(dtype=float)):
    x[0] = TUPLE[1][0]
run(tuple_of_numbers)

NUMPY = np.float32(16.5)  # numpy
@wp.kernel
def number_of_numpy(x: wp.array(dtype=float)):
    x[0] = float(NUMPY)
run(number_of_numpy)

class Config:
    SCALE = 17.5  # config
@wp.func
def read_from(settings: Any):
    return settings.SCALE
@wp.kernel
def class_as_argument(x: wp.array(dtype=float)):
    x[0] = read_from(Config)
run(class_as_argument)

@wp.struct
class Point:
    x: float
@wp.func
def mul(a: Point, b: Point):
    return a.x * b.x + 18.5  # operator
@wp.kernel
def operator_of_struct(x: wp.array(dtype=float), p: Point):
    x[0] = p * p
run(operator_of_struct, Point())

wp.mine = 19.5  # package
@wp.kernel
def attribute_of_package(x: wp.array(dtype=float)):
    x[0] = wp.mine
run(attribute_of_package)

Number = wp.float32  # type
@wp.kernel
def type_by_name(x: wp.array(dtype=float)):
    x[0] = float(Number(20.5))
run(type_by_name)

@wp.func
def cube(a: float):
    return a * a * a
@wp.func_grad(cube)
def cube_grad(a: float, adj: float):
    wp.adjoint[a] += adj * 21.5  # gradient
@wp.kernel
def custom_gradient(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    x[0] = cube(y[0])
x, y = (wp.ones(1, dtype=float, device="cpu", requires_grad=True) for _ in range(2))
with wp.Tape() as tape:
    wp.launch(custom_gradient, 1, [x, y], device="cpu")
tape.backward(grads={x: wp.ones(1, dtype=float, device="cpu")})
results["custom_gradient"] = float(y.grad.numpy()[0])

@wp.kernel(launch_constants=("order",))
def launch_constant(x: wp.array(dtype=float), order: int):
    value = float(0.0)
    if order == 22:
        value = 22.5
    for i in range(order):
        value = value + 0.0
    x[0] = value + 0.0 * float(order)
run(launch_constant, 22)

settings = types.SimpleNamespace(value=23.5)  # namespace
@wp.kernel
def plain_object(x: wp.array(dtype=float)):
    x[0] = settings.value
run(plain_object)

@wp.kernel
def tile_sum(x: wp.array(dtype=float)):
    t = wp.tile_ones(shape=(4,), dtype=float)
    wp.tile_store(x, wp.tile_sum(t) * 6.0)  # tile
wp.launch_tiled(tile_sum, [1], [x], block_dim=32, device="cpu")
results["tile_sum"] = float(x.numpy()[0])

class Shared:
    SCALE = 25.5  # shared
def choose(n):
    @wp.func
    def chosen(settings: Any):
        return settings.SCALE + wp.static(float(n - 1))
    return chosen
@wp.kernel
def function_from_static(x: wp.array(dtype=float)):
    for i in range(2):
        x[0] = wp.static(choose(i + 1))(Shared) - wp.static(float(i))
run(function_from_static)

ones = wp.ones(1, dtype=float, device="cpu")
results["map_lambda"] = float(
    wp.map(lambda a: a * 26.5, ones).numpy()[0]  # lambda
)

loaded = "warp._src.frontend.translator" in sys.modules
print(json.dumps([results, translated, loaded]))
"""
# Each change: the mark of its line, the replaced and the new text, the kernel, and its result.
CASES = [
    ("# own text", "1.5", "1.25", "own_text", 1.25),
    ("# deepest", "2.5", "2.0", "text_of_functions", 6.0),
    ("# global", "3.5", "3.25", "global_number", 3.25),
    ("# closure", "4.5", "4.25", "make_closure", 4.25),
    ("# vector", "5.5", "5.25", "global_vector", 5.25),
    ("# module", "6.5", "6.25", "attribute_of_module", 6.25),
    ("# base class", "7.5", "7.25", "inherited_attribute", 7.25),
    ("# int enum", "8", "800", "int_enum", 800.0),
    ("# enum", "9.5", "9.25", "value_of_enum", 9.25),
    ("# struct", "int", "float", "struct_layout", 12.0),
    ("# generic", "wp.float64(11.0)", "wp.int64(11)", "generic_argument", 5.0),
    ("# state", "12.5", "12.25", "static_call", 12.25),
    ("# table", "12.0", "11.0", "static_of_counter", 12.5),
    ("# default", "13.5", "13.25", "default_argument", 13.25),
    ("# alias", "float", "int", "annotation", 14.5),
    ("# operation", "add_up", "multiply", "combine_captured_function", 12.0),
    ("# tuple", "15.5", "15.25", "tuple_of_numbers", 15.25),
    ("# numpy", "16.5", "16.25", "number_of_numpy", 16.25),
    ("# config", "17.5", "17.25", "class_as_argument", 17.25),
    ("# operator", "18.5", "18.25", "operator_of_struct", 18.25),
    ("# package", "19.5", "19.25", "attribute_of_package", 19.25),
    ("# type", "wp.float32", "wp.int32", "type_by_name", 20.0),
    ("# gradient", "21.5", "21.25", "custom_gradient", 21.25),
    ("# shared", "25.5", "25.25", "function_from_static", 25.25),
    ("# lambda", "26.5", "26.25", "map_lambda", 26.25),
    ("# tile", "6.0", "7.0", "tile_sum", 28.0),
]
# They use what has no name that lasts.
ALWAYS = ["plain_object"]


def run(path, folder):
    status, out, err = programs.run(path, WARP_CACHE_PATH=folder)
    assert status == 0, f"{out}\n{err}"
    return json.loads(out.splitlines()[-1])


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The program, the cache that it has left, and what its kernels gave."""
    path = programs.write_program(PROGRAM)
    folder = tmp_path_factory.mktemp("cache")
    results, translated, _ = run(path, folder)
    assert set(translated) >= set(results) - {"generic_argument"}
    return path, folder, results


def test_nothing_is_translated_again(program):
    path, folder, results = program
    again, translated, loaded = run(path, folder)
    assert again == results
    assert translated == ALWAYS
    assert loaded


def test_front_end_is_not_even_loaded(tmp_path):
    # The latter finds the type of the results by translating the function.
    text = PROGRAM.replace("run(plain_object)", "")
    text = text.replace("wp.map(lambda a: a * 26.5, ones).numpy()[0]", "1.0")
    path = programs.write_program(text)
    run(path, tmp_path)
    _, translated, loaded = run(path, tmp_path)
    assert translated == []
    assert not loaded


@pytest.mark.parametrize("mark, old, new, kernel, expected", CASES, ids=[c[3] for c in CASES])
def test_what_changed_is_translated(program, mark, old, new, kernel, expected):
    path, folder, results = program
    lines = PROGRAM.split("\n")
    (place,) = [i for i, line in enumerate(lines) if line.endswith(mark)]
    assert old in lines[place]
    lines[place] = lines[place].replace(old, new, 1)
    try:
        path.write_text("\n".join(lines))
        found, translated, _ = run(path, folder)
    finally:
        path.write_text(PROGRAM)
    assert found[kernel] == expected != results[kernel]
    assert {name: value for name, value in found.items() if name != kernel} == {
        name: value for name, value in results.items() if name != kernel
    }
    if mark != "# operator":
        # All kernels of the module might use that one.
        assert [name for name in translated if name not in ALWAYS] == [kernel]


def test_damaged_translations_are_made_again(program):
    path, folder, results = program
    kept = {file: file.read_bytes() for file in Path(folder).glob("*.kernel")}
    assert len(kept) >= len(CASES)
    for i, (file, content) in enumerate(kept.items()):
        middle = len(content) // 2
        damages = (content[:middle], b"", content + b"x", content[:9] + b"\xff" + content[10:])
        file.write_bytes(damages[i % 4])
    found, translated, _ = run(path, folder)
    assert found == results
    assert len(set(translated)) >= len(CASES)
    assert run(path, folder)[1] == ALWAYS


def test_operators_of_structs_are_looked_for():
    """The front end calls functions of these names without a text that names them."""
    from warp._src.frontend import expressions
    from warp._src.kernels.identity import OPERATORS

    named = {*expressions._BINARY.values(), *(name for name, _ in expressions._COMPARE.values())}
    assert named <= set(OPERATORS)


def test_values_of_static_expressions_alternate(program):
    """Each value has a translation of its own, none takes the place of another."""
    path, folder, _ = program
    other = PROGRAM.replace("STATE = [12.5]", "STATE = [12.0]")
    for text in (other, PROGRAM, other, PROGRAM):
        path.write_text(text)
        found, translated, _ = run(path, folder)
        assert found["static_call"] == (12.0 if text == other else 12.5)
    assert translated == ALWAYS
