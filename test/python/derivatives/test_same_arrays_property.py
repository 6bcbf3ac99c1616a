"""Random kernels with several names for one array: gradients are those of what the launch does."""

import random
import types

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import warp as wp
from frontend_programs import define
from random_runs import examples

R = wp.float64
ROWS, COLUMNS = 3, 2
NAMES = ("a", "b", "c")
# Python names of the kernels' functions.
PYTHON = types.SimpleNamespace(float64=float, sin=np.sin)


def program(seed) -> str:
    """The body of a kernel whose threads have a row each."""
    draw, values, lines = random.Random(seed), [], []

    def place():
        return f"{draw.choice(NAMES)}[i, {draw.randrange(COLUMNS)}]"

    def term():
        if not values or draw.random() < 0.3:
            return "wp.float64(0.7)"
        one, other = draw.choice(values), draw.choice(values)
        return draw.choice([f"{one} * {other}", f"wp.sin({one})", f"{one} + {other}", one])

    for k in range(draw.randint(3, 8)):
        kind = draw.random()
        if kind < 0.45 or not values:
            lines.append(f"v{k} = {place()}")
            values.append(f"v{k}")
        elif kind < 0.8:
            lines.append(f"{place()} = {term()}")
        elif kind < 0.9:
            lines.append(f"{place()} += {term()}")
        else:
            lines.append(
                f"if {draw.choice(values)} > wp.float64(0.8):\n        {place()} = {term()}"
            )
    lines.append(f"out[i] = {term()} + {term()}")
    return "\n    ".join(lines)


def reference(body, x, launches):
    """The contents of both arrays after launches that all names are one array for."""
    space = {}
    exec(f"def run(i, a, b, c, out, wp):\n    {body}\n", space)
    x, out = x.copy(), np.zeros(ROWS)
    for _ in range(launches):
        for i in range(ROWS):
            space["run"](i, x, x, x, out, PYTHON)
    return x, out


def differences(body, x, launches, weights):
    """The gradient of a weighted sum by central differences."""

    def total(step, at):
        moved = x.copy()
        moved[at] += step
        return sum(np.sum(p * w) for p, w in zip(reference(body, moved, launches), weights))

    found = np.zeros_like(x)
    for at in np.ndindex(x.shape):
        found[at] = (total(1e-6, at) - total(-1e-6, at)) / 2e-6
    return found


@examples(20)
@given(st.integers(0, 10**9), st.integers(1, 2))
def test_gradients_of_random_kernels(seed, launches):
    body = program(seed)
    arguments = ", ".join(f"{name}: Matrix" for name in NAMES)
    source = f"@wp.kernel\ndef program({arguments}, out: Vector):\n    i = wp.tid()\n    {body}\n"
    kernel = define(source, Matrix=wp.array2d(dtype=R), Vector=wp.array(dtype=R))["program"]
    rng = np.random.default_rng(seed)
    start, tangent = rng.uniform(0.5, 1.5, (ROWS, COLUMNS)), rng.normal(size=(ROWS, COLUMNS))
    weights = rng.normal(size=(ROWS, COLUMNS)), rng.normal(size=ROWS)

    def run(x):
        out = wp.zeros(ROWS, dtype=R, device="cpu", requires_grad=True)
        for _ in range(launches):
            wp.launch(kernel, ROWS, [x, x, x, out], device="cpu")
        return x, out

    x = wp.array(start, dtype=R, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        made = run(x)
    for got, wanted in zip(made, reference(body, start, launches)):
        np.testing.assert_allclose(got.numpy(), wanted, rtol=1e-12, err_msg=source)
    seeds = [wp.array(w, dtype=R, device="cpu") for w in weights]
    tape.backward(grads=dict(zip(made, seeds)))
    wanted = differences(body, start, launches, weights)
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-5, atol=1e-6, err_msg=source)

    y = wp.array(start, dtype=R, device="cpu", requires_grad=True)
    pushed = wp.autograd.jvp(run, [y], [wp.array(tangent, dtype=R, device="cpu")])
    got = sum(np.sum(p.numpy() * w) for p, w in zip(pushed, weights))
    np.testing.assert_allclose(got, np.sum(tangent * wanted), rtol=1e-5, atol=1e-6, err_msg=source)
