"""Random kernels whose loops read what they wrote: exact gradients, backward and forward."""

import numpy as np
import pytest
from hypothesis import given

import warp as wp
from autodiff_chains import ORDER, PLACES, START, THREADS, WEIGHTS, kernels, reference
from frontend_programs import define
from random_runs import examples

REAL = wp.float64


def close(got, wanted, name, source):
    text = f"{name} of\n{source}"
    np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-10, err_msg=text)


def fresh(requires_grad):
    return {
        name: wp.array(data, dtype=REAL, device="cpu", requires_grad=requires_grad)
        for name, data in START.items()
    }


def check(kernel, n, source):
    indices = [wp.array(part, dtype=int, device="cpu") for part in (PLACES, ORDER)]
    made = fresh(True)
    seeds = {made[name]: wp.array(w, dtype=REAL, device="cpu") for name, w in WEIGHTS.items()}
    with wp.Tape() as tape:
        wp.launch(kernel, THREADS, [*made.values(), *indices, n], device="cpu")
    tape.backward(grads=seeds)
    contents, gradients = reference(source, n)
    for name, wanted in contents.items():
        close(made[name].numpy(), wanted, f"contents of '{name}'", source)
    for name, wanted in gradients.items():
        close(made[name].grad.numpy(), wanted, f"gradient by '{name}'", source)

    def forward(*arrays):
        wp.launch(kernel, THREADS, [*arrays, *indices, n], device="cpu")
        return [one for name, one in zip(START, arrays) if name in WEIGHTS]

    tangents = {name: np.cos(np.arange(v.size)).reshape(v.shape) for name, v in START.items()}
    given_tangents = [wp.array(v, dtype=REAL, device="cpu") for v in tangents.values()]
    pushed = wp.autograd.jvp(forward, list(fresh(True).values()), given_tangents)
    got = sum((p.numpy() * w).sum() for p, w in zip(pushed, WEIGHTS.values()))
    close(got, sum((tangents[k] * gradients[k]).sum() for k in START), "product", source)


@pytest.mark.parametrize("tape", ["checkpoints", "global"])
def test_gradients_of_random_chains(tape):
    @examples(25)
    @given(kernels())
    def run(source):
        ranks = {"A1": wp.array(dtype=REAL), "A2": wp.array2d(dtype=REAL)}
        ranks |= {"I1": wp.array(dtype=int), "I2": wp.array2d(dtype=int)}
        decorated = source.replace("def mix", "@wp.func\ndef mix")
        decorated = decorated.replace("def program", "@wp.kernel\ndef program")
        space = define(decorated, R=REAL, **ranks)
        space["program"].options["tape"] = tape
        for n in (0, 2, 4):
            check(space["program"], n, source)

    run()
