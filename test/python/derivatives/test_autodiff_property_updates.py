"""Random kernels that overwrite what they read: exact gradients."""

import numpy as np
from hypothesis import given

import warp as wp
from autodiff_updates import START, THREADS, WEIGHTS, kernels, reference
from frontend_programs import define
from random_runs import examples

REAL = wp.float64


def close(got, wanted, name, source):
    text = f"{name} of\n{source}"
    np.testing.assert_allclose(got.numpy(), wanted, rtol=1e-9, atol=1e-10, err_msg=text)


def check(kernel, n, source):
    made = {
        name: wp.array(data, dtype=REAL, device="cpu", requires_grad=True)
        for name, data in START.items()
    }
    seeds = {made[name]: wp.array(w, dtype=REAL, device="cpu") for name, w in WEIGHTS.items()}
    with wp.Tape() as tape:
        wp.launch(kernel, THREADS, [*made.values(), n], device="cpu")
    tape.backward(grads=seeds)
    contents, gradients = reference(source, n)
    for name, wanted in contents.items():
        close(made[name], wanted, f"contents of '{name}'", source)
    for name, wanted in gradients.items():
        close(made[name].grad, wanted, f"gradient by '{name}'", source)


@examples(60)
@given(kernels())
def test_gradients_of_random_updates(source):
    rank_one, rank_two = wp.array(dtype=REAL), wp.array2d(dtype=REAL)
    space = define("@wp.kernel\n" + source, R=REAL, A1=rank_one, A2=rank_two)
    for n in (0, 2, 4):
        check(space["program"], n, source)
