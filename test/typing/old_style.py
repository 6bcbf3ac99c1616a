"""The notation of older programs: calls as annotations, which checkers take for values."""

# pyright: reportInvalidTypeForm=false
# mypy: disable-error-code="valid-type"

import numpy as np

import warp as wp
import warp.sparse as sparse
from warp.optim import linear


@wp.struct
class Body:
    mass: float
    position: wp.vec3


@wp.kernel
def weigh(
    bodies: wp.array(dtype=Body),
    grid: wp.array(dtype=float, ndim=2),
    total: wp.array(dtype=float),
):
    i = wp.tid()
    b = bodies[i]
    wp.atomic_add(total, 0, b.mass * grid[i, 0])
    bodies[i].position = b.position + wp.vec3(1.0, 0.0, 0.0)


one = Body()
one.mass = 2.0
one.position = wp.vec3(0.0, 1.0, 0.0)
bodies = wp.array([one, one], dtype=Body)
grid = wp.array(np.ones((2, 3)), dtype=float, ndim=2)
total = wp.zeros(shape=1, dtype=float)
wp.launch(kernel=weigh, dim=2, inputs=[bodies, grid], outputs=[total])
assert total.numpy()[0] == 4.0

n = 8
rows = wp.array(np.arange(n), dtype=int)
diagonal = wp.full(n, 2.0, dtype=float)
matrix = sparse.bsr_from_triplets(n, n, rows, rows, diagonal)
b = wp.ones(n, dtype=float)
x = wp.zeros(n, dtype=float)
linear.cg(matrix, b, x, tol=1e-6)
y = sparse.bsr_mv(matrix, x)
assert np.allclose(x.numpy(), 0.5, atol=1e-4)
print(y.numpy())
