"""Gradients where branches and loops choose the array that is accessed."""

import numpy as np
import pytest

import warp as wp
from autodiff_catalogue.problem import only

REAL = wp.float64
rng = np.random.default_rng(5)
N = 6
A, B, X = rng.uniform(0.5, 1.5, (3, N))


@wp.kernel
def by_expression(a: wp.array(dtype=REAL), b: wp.array(dtype=REAL), out: wp.array(dtype=REAL)):
    i = wp.tid()
    s = a if i % 2 == 0 else b
    out[i] = s[i] * s[N - 1 - i]


@wp.kernel
def by_branches(a: wp.array(dtype=REAL), b: wp.array(dtype=REAL), out: wp.array(dtype=REAL)):
    i = wp.tid()
    s = a
    if i > 1:
        s = b[:]
        if i > 3:
            s = a[1:]
    out[i] = wp.sin(s[i % 5])


@wp.kernel
def by_loop(a: wp.array(dtype=REAL), b: wp.array(dtype=REAL), out: wp.array(dtype=REAL)):
    i = wp.tid()
    s = a
    t = b
    total = REAL(1.0)
    for k in range(i + 1):
        total = wp.sin(total * s[k] + t[i])
        s, t = t, s
    out[i] = total


@wp.kernel
def by_while(a: wp.array(dtype=REAL), b: wp.array(dtype=REAL), out: wp.array(dtype=REAL)):
    i = wp.tid()
    s = a
    total = REAL(0.1)
    while total < REAL(2.0):
        total += s[i] * total
        if total > REAL(1.0):
            s = b
    out[i] = total


def values_of(name, a, b):
    out = np.zeros(N, np.result_type(a, b))
    for i in range(N):
        if name == "by_expression":
            s = a if i % 2 == 0 else b
            out[i] = s[i] * s[N - 1 - i]
        elif name == "by_branches":
            s = a if i < 2 else b if i < 4 else a[1:]
            out[i] = np.sin(s[i % 5])
        elif name == "by_loop":
            s, t, total = a, b, 1.0
            for k in range(i + 1):
                total = np.sin(total * s[k] + t[i])
                s, t = t, s
            out[i] = total
        else:
            s, total = a, 0.1
            while np.real(total) < 2.0:
                total = total + s[i] * total
                if np.real(total) > 1.0:
                    s = b
            out[i] = total
    return out


@pytest.mark.parametrize("kernel", [by_expression, by_branches, by_loop, by_while])
def test_reads(kernel, device):
    arrays = [wp.array(v, dtype=REAL, device=device, requires_grad=True) for v in (A, B)]

    def run(a, b):
        out = wp.zeros(N, dtype=REAL, device=device, requires_grad=True)
        wp.launch(kernel, N, [a, b, out], device=device)
        return out

    with wp.Tape() as tape:
        out = run(*arrays)
    tape.backward(grads={out: wp.array(X, dtype=REAL, device=device)})
    np.testing.assert_allclose(out.numpy(), values_of(kernel.key, A, B), rtol=1e-14)
    wanted = np.zeros((2, N))
    for j in range(N):
        step = 1e-30j * np.eye(N)[j]
        wanted[0, j] = (values_of(kernel.key, A + step, B).imag * X).sum() / 1e-30
        wanted[1, j] = (values_of(kernel.key, A, B + step).imag * X).sum() / 1e-30
    for one, want in zip(arrays, wanted):
        np.testing.assert_allclose(one.grad.numpy(), want, rtol=1e-12, atol=1e-14)
    directions = rng.normal(size=(2, N))
    tangents = [wp.array(v, dtype=REAL, device=device) for v in directions]
    pushed = only(wp.autograd.jvp(run, arrays, tangents)).numpy()
    np.testing.assert_allclose(pushed @ X, (wanted * directions).sum(), rtol=1e-12)


def test_writes_and_updates(device):
    @wp.kernel
    def scatter(x: wp.array(dtype=REAL), a: wp.array(dtype=REAL), b: wp.array(dtype=REAL)):
        i = wp.tid()
        s = a if i % 2 == 0 else b
        s[i] = x[i] * x[i]
        t = b if i % 2 == 0 else a
        wp.atomic_add(t, i % 2, wp.sin(x[i]))  # No thread stores there.

    x, a, b = (wp.array(v, dtype=REAL, device=device, requires_grad=True) for v in (X, A, B))
    with wp.Tape() as tape:
        wp.launch(scatter, N, [x, a, b], device=device)
    seeds = rng.normal(size=(2, N))
    tape.backward(
        grads={
            a: wp.array(seeds[0], dtype=REAL, device=device),
            b: wp.array(seeds[1], dtype=REAL, device=device),
        }
    )
    even = np.arange(N) % 2 == 0
    wanted = 2.0 * X * np.where(even, *seeds) + np.cos(X) * np.where(even, seeds[1, 0], seeds[0, 1])
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-13)
    np.testing.assert_allclose(a.grad.numpy(), np.where(even, 0.0, seeds[0]), rtol=1e-13)
    np.testing.assert_allclose(b.grad.numpy(), np.where(even, seeds[1], 0.0), rtol=1e-13)


def test_views_that_only_a_branch_can_make_are_an_error():
    @wp.kernel
    def rows(m: wp.array2d(dtype=REAL), p: wp.array(dtype=int), out: wp.array(dtype=REAL)):
        i = wp.tid()
        s = m[0]
        if i > 1:
            s = m[p[i]]
        out[i] = s[i] * s[i]

    with pytest.raises(RuntimeError, match=r"py:\d+:\d+: the array .* depends on control flow"):
        rows.ir(derivative="adjoint")


@wp.struct
class Holder:
    values: wp.array(dtype=REAL)


def test_arrays_in_arrays_of_structs_are_an_error():
    @wp.kernel
    def first(holders: wp.array(dtype=Holder), out: wp.array(dtype=REAL)):
        out[0] = holders[0].values[0] * holders[0].values[1]

    with pytest.raises(RuntimeError, match=r"py:\d+:\d+: the array .* an array of structs"):
        first.ir(derivative="adjoint")
