"""Launch constants: code for the values of a scene, general code beyond a number of them."""

import re
import subprocess
import sys

import numpy as np
import pytest

import warp as wp
from warp._src.kernels.constants import MOST_SETS


@wp.struct
class Settings:
    gain: float
    order: int
    shift: wp.vec3


def body(x: wp.array(dtype=wp.vec3), y: wp.array(dtype=wp.vec3), s: Settings, damped: bool):
    i = wp.tid()
    power = wp.vec3(1.0, 1.0, 1.0)
    total = wp.vec3()
    for _ in range(s.order):
        total += power
        power = wp.cw_mul(power, x[i])
    if damped:
        total -= s.gain * wp.vec3(wp.sin(x[i][0]), wp.sin(x[i][1]), wp.sin(x[i][2]))
    y[i] = total + s.shift


NAMES = ("s.order", "s.gain", "damped")


def make(names=NAMES):
    return wp.kernel(name="powers", module="unique", launch_constants=names)(body)


def settings(order, gain=0.5):
    made = Settings()
    made.order, made.gain, made.shift = order, gain, wp.vec3(1.0, 0.0, -1.0)
    return made


def expected(x, order, gain, damped):
    x = x.astype(np.float64)
    total = sum((x**n for n in range(order)), np.zeros_like(x))
    return total - (gain * np.sin(x) if damped else 0.0) + (1.0, 0.0, -1.0)


def instructions(text):
    """The manifests of both kernels below, whatever their names."""
    text = re.sub(r"\w+_(general|by_hand)", "kernel", text)
    return [line for line in text.splitlines() if line.startswith("\t") and "param" not in line]


# C5: the code for constants is what one writes who knows them.
def test_code_is_as_if_written_for_the_values():
    def general(x: wp.array(dtype=float), y: wp.array(dtype=float), n: int, flag: bool, k: float):
        i = wp.tid()
        total = float(0.0)
        for j in range(n):
            total += x[i] * float(j)
        if flag:
            total += wp.exp(x[i])
        y[i] = k * total

    @wp.kernel
    def by_hand(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        total = float(0.0)
        for j in range(3):
            total += x[i] * float(j)
        y[i] = 1.0 * total

    kernel = wp.kernel(launch_constants=("n", "flag", "k"))(general)
    x, y = (wp.ones(100, dtype=float, device="cpu") for _ in range(2))
    wp.launch(kernel, 100, [x, y, 3, False, 1.0], device="cpu")
    (found,) = kernel.constant_sets
    assert found.native is not None and found.milliseconds >= 0.0
    for stage, arch in (("asm", 0), ("ptx", 90)):
        text = found.native.ir(stage, arch, 1)
        assert instructions(text) == instructions(by_hand.ir(stage, arch=arch or None)), stage
        assert "exp" not in text and "ex2" not in text
    assert y.numpy()[7] == 3.0
    (own,) = [one for one in wp.manifest(module=__name__) if one.variant == "constants"]
    assert own.kernel == kernel.key


def test_values_are_those_of_the_general_code(device):
    kernel, plain = make(), wp.kernel(name="powers_plain")(body)
    x = wp.array(
        np.random.default_rng(1).uniform(-1.0, 1.0, (257, 3)), dtype=wp.vec3, device=device
    )
    for order, gain, damped in ((0, 0.5, True), (3, -0.0, True), (3, 0.0, True), (40, 2.0, False)):
        results = []
        for one in (kernel, plain, kernel):
            y = wp.zeros(257, dtype=wp.vec3, device=device)
            wp.launch(one, 257, [x, y, settings(order, gain), damped], device=device)
            results.append(y.numpy())
        wanted = expected(x.numpy(), order, gain, damped)
        np.testing.assert_allclose(results[0], wanted, rtol=2e-5, atol=2e-5)
        np.testing.assert_allclose(results[0], results[1], rtol=1e-6, atol=1e-6)
        np.testing.assert_array_equal(results[0], results[2])
    sets = kernel.constant_sets
    # Zeros of either sign are different constants.
    assert [one.launches for one in sets] == [2, 2, 2, 2] and sets.hit_rate == 1.0
    assert "s.order=3" in str(sets) and "100% of the launches" in str(sets)


def test_sets_beyond_the_first_run_the_general_code():
    kernel = make()
    x = wp.full(5, wp.vec3(0.5, 0.25, -0.5), dtype=wp.vec3, device="cpu")
    for order in range(2 * MOST_SETS):
        y = wp.zeros(5, dtype=wp.vec3, device="cpu")
        wp.launch(kernel, 5, [x, y, settings(order), True], device="cpu")
        np.testing.assert_allclose(y.numpy(), expected(x.numpy(), order, 0.5, True), rtol=1e-5)
    assert len(kernel.constant_sets) == MOST_SETS
    kernel.module.mark_modified()
    assert kernel.constant_sets == ()


# Where code would hardly differ, the general code is kept and nothing more is compiled.
def test_constants_that_change_nothing_get_no_code():
    @wp.kernel(launch_constants=("k",))
    def scale(x: wp.array(dtype=float), k: float):
        x[wp.tid()] = x[wp.tid()] * k

    x = wp.ones(4, dtype=float, device="cpu")
    wp.launch(scale, 4, [x, 3.0], device="cpu")
    (found,) = scale.constant_sets
    assert found.native is None and scale.constant_sets.hit_rate == 0.0
    assert x.numpy().tolist() == [3.0] * 4


def test_an_error_for_some_values_is_none_of_the_launch():
    @wp.kernel(launch_constants=("n",))
    def pick(x: wp.array(dtype=wp.vec3), y: wp.array(dtype=float), n: int):
        i = wp.tid()
        if n < 3:
            y[i] = x[i][n] + wp.sqrt(float(n))
        else:
            y[i] = -1.0

    x, y = (
        wp.full(2, wp.vec3(1.0, 2.0, 3.0), dtype=wp.vec3, device="cpu"),
        wp.zeros(2, dtype=float, device="cpu"),
    )
    for n, wanted in ((2, 3.0 + np.sqrt(2.0)), (7, -1.0)):
        wp.launch(pick, 2, [x, y, n], device="cpu", outputs=[])
        assert y.numpy()[1] == pytest.approx(wanted)


# Derivatives, recorded launches and generic kernels.
def test_gradients_are_those_of_the_constants(device):
    kernel = make()
    start = np.random.default_rng(2).uniform(-1.0, 1.0, (33, 3))
    x = wp.array(start, dtype=wp.vec3, device=device, requires_grad=True)
    y = wp.zeros(33, dtype=wp.vec3, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, 33, [x, y, settings(4, 0.5), True], device=device)
    tape.backward(grads={y: wp.ones(33, dtype=wp.vec3, device=device)})
    wanted = 1.0 + 2.0 * start + 3.0 * start**2 - 0.5 * np.cos(start)
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-5, atol=1e-5)


def test_recorded_launches_may_change_their_constants():
    kernel = make(("damped", "s.order"))
    x, y = (wp.full(3, wp.vec3(0.5), dtype=wp.vec3, device="cpu") for _ in range(2))
    command = wp.launch(kernel, 3, [x, y, settings(2), True], device="cpu", record_cmd=True)
    command.launch()
    first = y.numpy().copy()
    command.set_param_by_name("damped", False)
    command.launch()
    np.testing.assert_allclose(first, expected(x.numpy(), 2, 0.5, True), rtol=1e-6)
    np.testing.assert_allclose(y.numpy(), expected(x.numpy(), 2, 0.5, False), rtol=1e-6)


def test_generic_kernels():
    @wp.kernel(launch_constants=("n",))
    def count(x: wp.array(dtype=wp.Float), n: wp.Int):
        i = wp.tid()
        for _ in range(n):
            x[i] = x[i] + x.dtype(1.0)

    for dtype, n in ((float, 3), (wp.float64, 5), (float, 3), (wp.float64, 3)):
        x = wp.zeros(4, dtype=dtype, device="cpu")
        wp.launch(count, 4, [x, n], device="cpu")
        assert x.numpy().tolist() == [n] * 4
    assert [one.launches for one in count.constant_sets] == [2, 1, 1]


PROGRAM = """
import sys, warp as wp
@wp.kernel
def one(x: wp.array(dtype=float)):
    x[0] = 1.0
wp.launch(one, 1, [wp.zeros(1, dtype=float, device="cpu")], device="cpu")
print(one.hooks == (), "warp._src.kernels.constants" in sys.modules)
"""


# C5: who does not use the feature does not load it, and has the short way of a launch.
def test_kernels_without_constants_know_nothing_of_them(tmp_path):
    file = tmp_path / "program.py"
    file.write_text(PROGRAM)
    done = subprocess.run([sys.executable, file], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False"]


def test_bad_names_and_values():
    for names, message in (
        (("speed",), "'speed' is no parameter of kernel 'powers'"),
        (("damped", "damped"), "'damped' is listed twice"),
    ):
        with pytest.raises(ValueError, match=re.escape(message)):
            make(names)
    with pytest.raises(TypeError, match="expects names of parameters, but got 'damped'"):
        make("damped")
    x = wp.zeros(1, dtype=wp.vec3, device="cpu")
    values = [x, x, settings(1), True]
    with pytest.raises(TypeError, match="constant 'x' expects a number.* but got"):
        wp.launch(make(("x",)), 1, values, device="cpu")
    with pytest.raises(ValueError, match="constant 's.mass' is no field of a struct"):
        wp.launch(make(("s.mass",)), 1, values, device="cpu")
    with pytest.raises(TypeError, match="argument 'damped'"):
        wp.launch(make(), 1, [x, x, settings(1), "yes"], device="cpu")
    with pytest.raises(TypeError, match="expects 4 arguments .*but got 2"):
        wp.launch(make(), 1, [x, x], device="cpu")
