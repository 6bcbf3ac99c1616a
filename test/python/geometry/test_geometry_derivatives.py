"""Derivatives of closest points, rays and sums over neighbours: formulas and differences."""

import numpy as np

import warp as wp

RANDOM = np.random.default_rng(5)


@wp.kernel
def distance(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    q = wp.mesh_query_point(mesh, x[i], 1.0e6)
    p = wp.mesh_eval_position(mesh, q.face, q.u, q.v)
    out[i] = wp.length(p - x[i]) * q.sign


@wp.kernel
def meet(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    dir: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=float),
):
    i = wp.tid()
    q = wp.mesh_query_ray(mesh, start[i], dir[i], 1.0e6)
    p = wp.mesh_eval_position(mesh, q.face, q.u, q.v)
    out[i] = 2.0 * q.t + p[0] + 0.5 * p[1]


@wp.kernel
def spread(grid: wp.uint64, x: wp.array(dtype=wp.vec3), h: float, out: wp.array(dtype=float)):
    i = wp.tid()
    s = float(0.0)
    for j in wp.hash_grid_query(grid, x[i], h):
        d = x[i] - x[j]
        s += wp.max(h * h - wp.dot(d, d), 0.0)
    out[i] = s


def array(values):
    return wp.array(values, dtype=wp.vec3, device="cpu", requires_grad=True)


def gradients(kernel, handle, arrays, *rest):
    n = len(arrays[0])
    out = wp.zeros(n, dtype=float, device="cpu", requires_grad=True)
    tape = wp.Tape()
    with tape:
        wp.launch(kernel, dim=n, inputs=[handle, *arrays, *rest], outputs=[out], device="cpu")
    out.grad.fill_(1.0)
    tape.backward()
    return out.numpy(), [a.grad.numpy() for a in arrays]


def box():
    """The cube [-1, 1]^3, of which distances are known."""
    corners = [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return wp.Mesh(
        wp.array(corners, dtype=wp.vec3, device="cpu"),
        wp.array(np.ravel(faces), dtype=int, device="cpu"),
    )


def test_signed_distance_has_the_gradient_of_its_formula():
    mesh = box()
    x = (RANDOM.random((300, 3)) * 5 - 2.5).astype(np.float32)
    value, (gradient,) = gradients(distance, mesh.id, [array(x)])
    excess = np.abs(x.astype(float)) - 1
    outside = np.maximum(excess, 0)
    inside = excess.max(1) < 0
    expected = np.where(inside, excess.max(1), np.linalg.norm(outside, axis=1))
    direction = outside / np.maximum(np.linalg.norm(outside, axis=1, keepdims=True), 1e-30)
    direction[inside] = np.eye(3)[excess.argmax(1)][inside]
    assert np.allclose(value, expected, atol=1e-6)
    assert np.allclose(gradient, np.sign(x) * direction, atol=2e-5)
    assert inside.sum() > 10


def test_rays_follow_start_and_direction():
    mesh = box()
    start = np.column_stack([RANDOM.random((200, 2)) - 0.5, np.full(200, -3.0)]).astype(np.float32)
    aim = np.array([0, 0, 1]) + 0.2 * (RANDOM.random((200, 3)) - 0.5)
    value, (by_start, by_dir) = gradients(meet, mesh.id, [array(start), array(aim)])
    # All meet the plane z = -1: t = (-1 - s_z) / d_z, p = s + t d.
    s, d = start.astype(float), aim.astype(np.float32).astype(float)
    t = (-1 - s[:, 2]) / d[:, 2]
    p = s + t[:, None] * d
    assert (np.abs(p[:, :2]) < 1).all()
    assert np.allclose(value, 2 * t + p[:, 0] + 0.5 * p[:, 1], atol=1e-5)
    slope = 2 + d[:, 0] + 0.5 * d[:, 1]
    expected = np.column_stack([np.ones(200), np.full(200, 0.5), -slope / d[:, 2]])
    assert np.allclose(by_start, expected, atol=1e-4)
    assert np.allclose(by_dir, expected * t[:, None], atol=3e-4)


def test_sums_over_neighbours():
    n, h = 200, 0.4
    x = RANDOM.random((n, 3)).astype(np.float32)
    points = array(x)
    grid = wp.HashGrid(8, 8, 8, device="cpu")
    grid.build(points, h)
    value, (gradient,) = gradients(spread, grid.id, [points], h)
    off = x[:, None].astype(float) - x[None]
    room = h * h - (off**2).sum(2)
    assert np.allclose(value, np.maximum(room, 0).sum(1), atol=1e-5)
    assert np.allclose(gradient, (-4 * off * (room > 0)[..., None]).sum(1), atol=1e-4)
