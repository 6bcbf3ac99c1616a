"""T83 to T86, T102: arrays that other launches overwrite, copies, inspection."""

import warp as wp

from .problem import gradient, kernel
from .registry import ERROR, case


def square_kernel(p):
    """y[i] = x[i]²."""
    R = p.real

    @kernel
    def squares(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i] * x[i]

    return squares


def scale_kernel(p):
    """x[i] = 10 x[i]."""
    R = p.real

    @kernel
    def scales(x: wp.array(dtype=R)):
        i = wp.tid()
        x[i] = R(10.0) * x[i]

    return scales


@case("T83", "arguments that overlap, one of them written, are refused", verdict=ERROR)
def overlap(p):
    squares = square_kernel(p)

    def run():
        x = p.array(p.random(8))
        ahead = x[1:]
        with wp.Tape() as tape:
            p.launch(squares, 7, [x], [ahead])
        tape.backward(grads={ahead: p.seed(ahead)})

    p.refuses(run, "x", "y", "overlap", lines=0)


@case("T84", "an array that is overwritten before backward is found, or kept on request")
def overwritten(p):
    squares, scales = square_kernel(p), scale_kernel(p)
    data = p.random(4)

    def run(**options):
        x, y = p.array(data), p.zeros(4)
        with wp.Tape(**options) as tape:
            p.launch(squares, 4, [x], [y])
            p.launch(scales, 4, [x])
        tape.backward(grads={y: p.seed(y)})
        return gradient(x)

    p.refuses(lambda: run(preserve="never"), "squares", "scales", lines=0)
    p.close(run(), 2.0 * data)


@case("T85", "a copied array has the gradients of both")
def copied(p):
    squares = square_kernel(p)
    data = p.random(4)
    x, y, z = p.array(data), p.zeros(4), p.zeros(4)
    with wp.Tape() as tape:
        wp.copy(y, x)
        p.launch(squares, 4, [x], [z])
    tape.backward(grads={y: p.seed(y, 3.0), z: p.seed(z)})
    p.close(gradient(x), 3.0 + 2.0 * data)


@case("T86", "looking at the gradient of an output does not change others")
def inspected(p):
    R = p.real

    @kernel
    def twice(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i]
        y[i] = R(2.0) * x[i]

    squares = square_kernel(p)
    data = p.random(4)

    def run(retain):
        x, z = p.array(data), p.zeros(4)
        y = wp.zeros(4, dtype=R, device=p.device, requires_grad=True, retain_grad=retain)
        with wp.Tape() as tape:
            p.launch(twice, 4, [x], [y])
            p.launch(squares, 4, [y], [z])
        tape.backward(grads={z: p.seed(z)})
        return gradient(x), gradient(y)

    got, seen = run(True)
    p.close(got, 8.0 * data)
    p.same(got, run(False)[0])
    p.close(seen, 4.0 * data)


@case("T102", "an array in a struct that is overwritten before backward is found", verdict=ERROR)
def overwritten_in_struct(p):
    R = p.real

    @wp.struct
    class State:
        x: wp.array(dtype=R)

    @kernel
    def squares(state: State, y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = state.x[i] * state.x[i]

    @kernel
    def scales(state: State):
        i = wp.tid()
        state.x[i] = R(10.0) * state.x[i]

    def run():
        state = State()
        state.x = p.array(p.random(4))
        y = p.zeros(4)
        with wp.Tape(preserve="never") as tape:
            p.launch(squares, 4, [state], [y])
            p.launch(scales, 4, [state])
        tape.backward(grads={y: p.seed(y)})

    p.refuses(run, "squares", "scales", lines=0)
