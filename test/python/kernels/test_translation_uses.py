"""Kernels from the cache do what others do: variants, checks of handles, derivatives."""

import json

import programs

LATER = """
import sys
import warp as wp
wp.config.quiet = True
NUMBER = 2.0

@wp.kernel
def scale(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = x[i] * NUMBER

x = wp.ones(4, dtype=float, device="cpu", requires_grad=True)
if len(sys.argv) == 1:
    wp.launch(scale, 4, [x], device="cpu")
else:
    # Code for arrays that are not packed, and a derivative, are made from the translation.
    wp.launch(scale, 4, [x], device="cpu")
    NUMBER = 3.0
    wp.launch(scale, 2, [x[::2]], device="cpu")
    print(x.numpy().tolist())
    y = wp.ones(4, dtype=float, device="cpu", requires_grad=True)
    wp.launch(scale, 4, [y], adj_inputs=[y.grad], adjoint=True, device="cpu")
    print(scale.ir("warp").count("2.0"), "warp._src.frontend.translator" in sys.modules)
"""


def test_constants_of_a_kernel_from_the_cache_stay(tmp_path):
    path = programs.write_program(LATER)
    assert programs.run(path, WARP_CACHE_PATH=tmp_path)[0] == 0
    status, out, err = programs.run(path, "again", WARP_CACHE_PATH=tmp_path)
    assert status == 0, err
    assert out.splitlines()[0] == "[4.0, 2.0, 4.0, 2.0]"
    assert out.splitlines()[1].endswith("False")


SEARCH = """
import sys
import numpy as np
import warp as wp
wp.config.quiet = True

@wp.kernel
def ask(grid: wp.uint64, x: wp.array(dtype=float)):
    query = wp.hash_grid_query(grid, wp.vec3(0.0), 1.0)
    index = int(0)
    while wp.hash_grid_query_next(query, index):
        x[0] = x[0] + 1.0

points = wp.array([(0.1, 0.0, 0.0), (0.0, 0.2, 0.0)], dtype=wp.vec3, device="cpu")
grid = wp.HashGrid(8, 8, 8, device="cpu")
grid.build(points, 1.0)
x = wp.zeros(1, dtype=float, device="cpu")
wp.launch(ask, 1, [grid.id, x], device="cpu")
try:
    wp.launch(ask, 1, [wp.uint64(0), x], device="cpu")
except wp.WarpLaunchError as problem:
    print(float(x.numpy()[0]), "expects the id of a live HashGrid" in str(problem))
print("warp._src.frontend.translator" in sys.modules)
"""


def test_launches_check_handles_of_a_kernel_from_the_cache(tmp_path):
    path = programs.write_program(SEARCH)
    for loaded in ("True", "False"):
        status, out, err = programs.run(path, WARP_CACHE_PATH=tmp_path)
        assert status == 0, err
        assert out.split() == ["2.0", "True", loaded]


GRADIENT = """
import json, sys
import warp as wp
from warp._src.derivatives import kernel_derivatives
wp.config.quiet = True
made = []
original = kernel_derivatives.differentiate
def noted(native, active, *rest, **options):
    made.append(list(active))
    return original(native, active, *rest, **options)
kernel_derivatives.differentiate = noted

@wp.kernel
def powers(x: wp.array(dtype=float), w: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    value = float(1.0)
    for k in range(int(w[i])):
        value = wp.sin(value) * x[i]
    y[i] = value * 2.0  # factor

def gradients(both):
    x = wp.array([0.5, 0.75], dtype=float, device="cpu", requires_grad=True)
    w = wp.array([3.0, 2.0], dtype=float, device="cpu", requires_grad=both)
    y = wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(powers, 2, [x, w, y], device="cpu")
    tape.backward(grads={y: wp.ones(2, dtype=float, device="cpu")})
    return x.grad.numpy().tolist()

results = [gradients(False)]
if len(sys.argv) > 1:
    results.append(gradients(True))
loaded = "warp._src.frontend.translator" in sys.modules
print(json.dumps([results, made, loaded]))
"""


def test_derivatives_come_from_the_cache(tmp_path):
    """Derivatives that were asked for before; others are made of the translation."""
    path = programs.write_program(GRADIENT)

    def run_it(*arguments):
        status, out, err = programs.run(path, *arguments, WARP_CACHE_PATH=tmp_path)
        assert status == 0, err
        return json.loads(out.splitlines()[-1])

    first, made, loaded = run_it()
    assert (made, loaded) == ([[True, False, True]], True)
    assert run_it() == [first, [], False]
    results, made, loaded = run_it("both")
    assert results == first * 2
    assert (made, loaded) == ([[True, True, True]], False)
    assert run_it("both")[1] == []
    path.write_text(GRADIENT.replace("2.0  # factor", "4.0  # factor"))
    doubled, made, _ = run_it()
    assert doubled == [[2.0 * value for value in first[0]]]
    assert made == [[True, False, True]]


HOSTILE = """
import types
import warp as wp
from warp._src.kernels import translations
wp.config.quiet = True

class Hostile:
    def __getattribute__(self, name):
        raise ValueError(name)
    def __eq__(self, other):
        raise ValueError("no")
    __hash__ = None

def refuse(name):
    raise OSError(name)

lazy = types.ModuleType("lazy")
lazy.__getattr__ = refuse
lazy.VALUE = 2.5
hostile, circle, table = Hostile(), [], {}
circle.append(circle)
table[Hostile] = table

@wp.kernel
def near_others(x: wp.array(dtype=float)):
    # hostile, circle, table
    x[0] = lazy.VALUE

x = wp.zeros(1, dtype=float, device="cpu")
wp.launch(near_others, 1, [x], device="cpu")
print(float(x.numpy()[0]))
"""


def test_hostile_objects_do_no_harm(tmp_path):
    path = programs.write_program(HOSTILE)
    for _ in range(2):
        status, out, err = programs.run(path, WARP_CACHE_PATH=tmp_path)
        assert status == 0, err
        assert out.strip() == "2.5"
