"""Adjoints in modules that are compiled ahead of time."""

import os
import subprocess
import sys

import numpy as np
import pytest

import warp as wp

ENVIRON = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}

SOURCE = """
import warp as wp

@wp.struct
class Model:
    weights: wp.array(dtype=wp.vec2)
    scale: float
    labels: wp.array(dtype=int)

@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]

@wp.kernel
def grow(x: wp.array(dtype=float), m: Model):
    i = wp.tid()
    x[i] = x[i] * wp.exp(m.weights[i][0]) * m.scale

@wp.kernel
def count(n: wp.array(dtype=int)):
    wp.atomic_add(n, 0, 1)

@wp.kernel(enable_backward=False)
def halve(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 0.5 * x[i]

@wp.kernel
def drift(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i + 1]

@wp.kernel
def scale(x: wp.array(dtype=wp.Float), y: wp.array(dtype=wp.Float)):
    i = wp.tid()
    y[i] = wp.sin(x[i])
"""

RUN = """
import sys
sys.path.insert(0, sys.argv[1])
import saved_adjoints as m
import warp as wp
wp.config.quiet = True
wp.config.cache_kernels = False
device = sys.argv[2]
wp.load_aot_module(m, device=device, module_dir=sys.argv[1], strip_hash=True)
def variable(values, dtype=float):
    return wp.array(values, dtype=dtype, device=device, requires_grad=True)
x, y = variable([1.0, 2.0, 3.0]), variable([0.0, 0.0, 0.0])
model = m.Model(weights=variable([[0.0, 1.0]] * 3, wp.vec2), scale=2.0)
model.labels = wp.zeros(3, dtype=int, device=device)
a, b = variable([0.0, 1.0], wp.float64), variable([0.0, 0.0], wp.float64)
u, v = variable([1.0, 2.0, 3.0]), variable([0.0, 0.0])
with wp.Tape() as tape:
    wp.launch(m.square, 3, [x, y], device=device)
    wp.launch(m.grow, 3, [y, model], device=device)
    wp.launch(m.scale, 2, [a, b], device=device)
    wp.launch(m.drift, 2, [u, v], device=device)
seeds = {y: wp.ones(3, device=device), b: wp.ones(2, wp.float64, device)}
tape.backward(grads={**seeds, v: wp.ones(2, device=device)})
print(x.grad.numpy().tolist())
print(model.weights.grad.numpy().tolist())
print(a.grad.numpy().tolist())
print(u.grad.numpy().tolist())
from warp._src.derivatives.saved import parts
kernels = (m.square, m.grow, m.scale, m.drift)
found = {
    (k.key, part): n
    for k in kernels
    for part, n in parts(k.derivatives.last_adjoint()).items()
}
# It gathers, so its parts run.
del found["drift", "adjoint"]
print([bool(native.compile_times().get("compile")) for native in found.values()])
"""


@pytest.fixture
def example(tmp_path, monkeypatch):
    """A Python module with kernels, imported from a folder of its own."""
    (tmp_path / "saved_adjoints.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("saved_adjoints", None)
    import saved_adjoints

    wp.get_module("saved_adjoints").options.clear()
    x = wp.zeros(1, dtype=wp.float64, device="cpu")
    wp.launch(saved_adjoints.scale, 1, [x, x], device="cpu")
    yield saved_adjoints
    sys.modules.pop("saved_adjoints", None)


def save(example, folder, device="cpu", **options):
    options = {"module_dir": folder, "strip_hash": True, **options}
    (path,) = wp.compile_aot_module(example, device=device, **options)
    return path


def names(path):
    return [name for name, *_ in wp._native.SavedModule(str(path)).kernels]


PRIMAL = ["count", "drift", "grow", "halve", "scale_array1xf64_array1xf64", "square"]
ADJOINT = [
    "drift.adjoint.11",
    "drift.sums.11",
    "drift.rest.11",
    "grow.adjoint.110",
    "scale_array1xf64_array1xf64.adjoint.11",
    "square.adjoint.11",
]


def test_adjoints_are_saved_where_they_are_asked_for(example, tmp_path):
    plain = save(example, tmp_path)
    content = plain.read_bytes()
    assert names(plain) == PRIMAL
    assert save(example, tmp_path, enable_backward=False).read_bytes() == content
    assert names(save(example, tmp_path, enable_backward=True)) == PRIMAL + ADJOINT
    options = wp.get_module("saved_adjoints").options
    options["enable_backward"] = True
    assert names(save(example, tmp_path)) == PRIMAL + ADJOINT
    options["enable_backward"] = False
    assert names(save(example, tmp_path, enable_backward=True)) == PRIMAL


def test_cases_of_gradients_that_are_named_or_were_used(example, tmp_path):
    path = save(example, tmp_path, gradients={"grow": [["x"], ["m.weights"], ["x", "m.weights"]]})
    saved = [f"grow.adjoint.{one}" for one in ("100", "010", "110")]
    assert names(path) == PRIMAL + saved
    x = wp.ones(2, device="cpu", requires_grad=True)
    model = example.Model(weights=wp.zeros(2, wp.vec2, "cpu"), scale=2.0)
    model.labels = wp.zeros(2, int, "cpu")
    with wp.Tape() as tape:
        wp.launch(example.grow, 2, [x, model], device="cpu")
    tape.backward(grads={x: wp.ones(2, device="cpu")})
    assert "grow.adjoint.100" in names(save(example, tmp_path, enable_backward=True))
    for gradients, message in (
        ({"grow": [["y"]]}, "has no floating-point array 'y', it has: x, m.weights"),
        ({"grow": [["m.labels"]]}, "has no floating-point array 'm.labels'"),
        ({"shrink": [["x"]]}, "has no kernel 'shrink' for `gradients`"),
    ):
        with pytest.raises(ValueError, match=message):
            save(example, tmp_path, gradients=gradients)


def test_backward_in_another_process_compiles_nothing(example, tmp_path, device):
    def run():
        return subprocess.run(
            [sys.executable, "-c", RUN, tmp_path, device],
            capture_output=True,
            text=True,
            env=ENVIRON,
        )

    for enable_backward in (True, False):
        save(example, tmp_path, device, enable_backward=enable_backward)
        done = run()
        assert done.stderr == ""
        lines = done.stdout.splitlines()
        # y is 2 x^2 exp(w), at w = 0.
        assert lines[0] == "[4.0, 8.0, 12.0]"
        assert lines[1] == "[[2.0, 0.0], [8.0, 0.0], [18.0, 0.0]]"
        assert np.allclose(eval(lines[2]), np.cos([0.0, 1.0]), rtol=1e-15)
        assert lines[3] == "[2.0, 4.0, 2.0]"
        assert set(eval(lines[4])) == {not enable_backward}


def test_other_cases_are_compiled_as_usual(example, tmp_path):
    save(example, tmp_path, gradients={"square": [["x"]]})
    wp.load_aot_module(example, device="cpu", module_dir=tmp_path, strip_hash=True)
    x = wp.array([1.0, 2.0], dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(2, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(example.square, 2, [x, y], device="cpu")
    tape.backward(grads={y: wp.ones(2, device="cpu")})
    assert np.array_equal(x.grad.numpy(), [2, 4])
