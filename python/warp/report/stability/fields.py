"""Distance to surfaces and its gradient: G16."""

import numpy as np

import warp as wp
from warp.report.stability._case import case
from warp.report.stability.geometry import HALVES, SQUARE, make_mesh


@wp.kernel
def measure(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), distance: wp.array(dtype=float)):
    i = wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, x[i], 1.0e6)
    if found.result:
        distance[i] = wp.length(x[i] - wp.mesh_eval_position(mesh, found.face, found.u, found.v))


def distances(p, mesh, points):
    """Distances of points from a surface, and their gradients."""
    x = p.array(points, wp.vec3, requires_grad=True)
    distance = p.zeros(len(points), wp.float32, requires_grad=True)
    with wp.Tape() as tape:
        p.launch(measure, len(points), mesh.id, x, distance)
    tape.backward(grads={distance: p.array(np.ones(len(points)), wp.float32)})
    return distance.numpy(), x.grad.numpy().astype(np.float64)


@case("G16", "distance in thin gaps, its gradient beside and on the plane between", ("float32",))
def thin_gap(p):
    for gap in (1e-1, 1e-3, 1e-6):
        low, high = (SQUARE + np.float32([0, 0, z]) for z in (-gap / 2, gap / 2))
        sheets = np.concatenate([low, high])
        mesh = make_mesh(p, sheets, [*HALVES, *((a + 4, b + 4, c + 4) for a, b, c in HALVES)])
        x = np.float32(p.random.uniform(0.1, 0.9, (2000, 3)))
        x[:, 2] = gap * p.random.uniform(-0.49, 0.49, len(x))
        distance, slope = distances(p, mesh, x)
        exact = np.float32(gap / 2).astype(float) - np.abs(x[:, 2].astype(float))
        # Nearest points have coordinates of size 1, so their rounding tilts short distances.
        p.check(f"gap {gap}: distance", distance - exact, 4 * p.u, x=x)
        limit = np.maximum(16 * p.u, (4 * p.u / exact) ** 2)
        norm = np.linalg.norm(slope, axis=1)
        p.check(f"gap {gap}: norm of the gradient over its bound", (norm - 1) / limit, 1.0, x=x)
        aim = slope[:, 2] + np.sign(x[:, 2])
        p.check(f"gap {gap}: away from the nearer sheet", aim / limit, 1.0, x=x)
        # Both directions are right on the plane between; their mean, 0, would stop a descent.
        x[:, 2] = 0.0
        distance, slope = distances(p, mesh, x)
        limit = max(16 * p.u, (8 * p.u / gap) ** 2)
        p.check(f"gap {gap}: one of both there", (np.abs(slope[:, 2]) - 1) / limit, 1.0, x=x)
