"""Costs of derivatives in a program that never differentiates, and their settings."""

import os
import subprocess
import sys

import numpy as np
import pytest

import warp as wp
from frontend_programs import define

ENVIRON = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}

SOURCE = """
@wp.func
def potential(r: float, k: float):
    return 0.5 * k * r * r

@wp.kernel{options}
def relax(x: wp.array(dtype=wp.vec3), e: wp.array(dtype=float), k: float):
    i = wp.tid()
    for _ in range(30):
        x[i] = 0.9 * x[i]
    wp.atomic_add(e, 0, potential(wp.length(x[i]), k))
"""


def saved(folder, options="", differentiate=False, **module_options):
    """The code of a module for a CPU and two GPUs."""
    wp.get_module("frontend_program").kernels.clear()
    space = define(SOURCE.format(options=options))
    module = wp.get_module("frontend_program")
    before = dict(module.options)
    wp.set_module_options(module_options, module)
    if differentiate:
        x = wp.ones(4, dtype=wp.vec3, device="cpu", requires_grad=True)
        e = wp.zeros(1, device="cpu", requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(space["relax"], 4, [x, e, 2.0], device="cpu")
        tape.backward(e)
        assert np.abs(x.grad.numpy()).min() > 0
    paths = wp.compile_aot_module(
        module, device="cpu", arch=[80, 90], module_dir=folder, strip_hash=True
    )
    module.options.clear()
    module.options.update(before)
    return [path.read_bytes() for path in paths]


def test_code_is_the_same_with_and_without_derivatives(tmp_path):
    plain = saved(tmp_path)
    assert len(plain) == 3 and all(len(code) > 500 for code in plain)
    assert saved(tmp_path, "(enable_backward=False)") == plain
    assert saved(tmp_path, enable_backward=False) == plain
    assert saved(tmp_path, differentiate=True) == plain


RUN = """
import os, sys
sys.path.insert(0, sys.argv[1])
import undifferentiated as m
import warp as wp
wp.config.quiet = True
x = wp.ones(4, dtype=wp.vec3, device="cpu", requires_grad=True)
e = wp.zeros(1, device="cpu", requires_grad=True)
wp.launch(m.relax, 4, [x, e, 2.0], device="cpu")
e.numpy()
inner = "backward finite origin saved"
unwanted = ["warp._src.autograd", "warp._src.optim"]
unwanted += ["warp._src.derivatives." + name for name in inner.split()]
print([name for name in unwanted if name in sys.modules])
print(sum(len(files) for _, _, files in os.walk(sys.argv[2])))
if len(sys.argv) > 3:
    with wp.Tape() as tape:
        wp.launch(m.relax, 4, [x, e, 2.0], device="cpu")
    tape.backward(e)
    print(sum(len(files) for _, _, files in os.walk(sys.argv[2])))
"""


def test_nothing_is_made_before_the_first_backward_pass(tmp_path):
    (tmp_path / "undifferentiated.py").write_text("import warp as wp\n" + SOURCE.format(options=""))
    cache = tmp_path / "cache"
    cache.mkdir()

    def run(*more):
        done = subprocess.run(
            [sys.executable, "-c", RUN, tmp_path, cache, *more],
            capture_output=True,
            text=True,
            env={**ENVIRON, "WARP_CACHE_PATH": str(cache)},
        )
        assert done.stderr == ""
        return done.stdout.splitlines()

    modules, files = run()
    assert modules == "[]" and int(files) > 0
    # The files of the second run show that gradients of arrays alone made none.
    assert run("backward")[1] == files and int(run("backward")[2]) > int(files)


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel(enable_backward=True)
def always(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


def gradient(kernel, device):
    x = wp.array([1.0, 2.0, 3.0], dtype=float, requires_grad=True, device=device)
    y = wp.zeros(3, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(kernel, 3, [x, y], device=device)
    assert np.array_equal(y.numpy(), [1, 4, 9])
    tape.backward(grads={y: wp.ones(3, device=device)})
    return x.grad.numpy().tolist()


def test_setting_and_options(device, monkeypatch):
    message = r"gradient of the launch of 'square' at .*the kernel has `enable_backward=False`"
    module = wp.get_module(__name__)
    assert gradient(square, device) == [2, 4, 6]
    monkeypatch.setattr(wp.config, "enable_backward", False)
    with pytest.raises(RuntimeError, match=message):
        gradient(square, device)
    assert gradient(always, device) == [2, 4, 6]
    module.options["enable_backward"] = True
    try:
        assert gradient(square, device) == [2, 4, 6]
        monkeypatch.setattr(wp.config, "enable_backward", True)
        module.options["enable_backward"] = False
        with pytest.raises(RuntimeError, match=message):
            gradient(square, device)
        assert gradient(always, device) == [2, 4, 6]
    finally:
        del module.options["enable_backward"]


@pytest.fixture
def verify(monkeypatch):
    monkeypatch.setattr(wp.config, "verify_autograd_array_access", True)


@wp.kernel
def double(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 2.0 * x[i]


def variables(device):
    x = wp.array([1.0, 2.0, 3.0], dtype=float, requires_grad=True, device=device)
    return x, wp.zeros(3, dtype=float, requires_grad=True, device=device)


def test_overwriting_is_told_where_it_happens(device, verify, capsys):
    x, y = variables(device)
    with wp.Tape(preserve="never"):
        wp.launch(square, 3, [x, y], device=device)
        wp.launch(double, 3, [y, x], device=device)
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 1 and told[0].startswith(__file__)
    assert "the launch of 'double' overwrites an array that has already been read from" in told[0]
    assert "the gradient of the launch of 'square' at test_enable_backward.py" in told[0]
    for write in (
        lambda x, y: x.assign(y),
        lambda x, y: x[1:].zero_(),
        lambda x, y: wp.copy(x, y, count=1),
    ):
        x, y = variables(device)
        with wp.Tape(preserve="never") as tape:
            wp.launch(square, 3, [x, y], device=device)
        write(x, y)
        assert "depends on its array 'x'" in capsys.readouterr().err
        with pytest.raises(RuntimeError, match="its array 'x' has been overwritten"):
            tape.backward(grads={y: wp.ones(3, device=device)})


def test_nothing_is_told_of_what_no_gradient_needs(device, verify, capsys):
    seed = wp.ones(3, device=device)
    for _ in range(2):
        x, y = variables(device)
        with wp.Tape(preserve="never") as tape:
            wp.launch(square, 3, [x, y], device=device)
            # Linear: no gradient depends on what 'y' holds.
            wp.launch(double, 3, [y, wp.zeros_like(x)], device=device)
            y.zero_()
        tape.backward(grads={y: seed})
        x.zero_()
        assert capsys.readouterr().err == ""
    x, y = variables(device)
    with wp.Tape() as tape:
        wp.launch(square, 3, [x, y], device=device)
        x.zero_()
    tape.backward(grads={y: seed})
    told = capsys.readouterr().err
    assert np.array_equal(x.grad.numpy(), [2, 4, 6]) and "of which the tape keeps a copy" in told
    with wp.Tape():
        wp.launch(double, 3, [x, y], device=device)
        wp.copy(x, y)
    told = capsys.readouterr().err
    assert (
        "the copy overwrites an array" in told and "no gradient of the launch of 'double'" in told
    )
