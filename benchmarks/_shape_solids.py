"""Kernels of shapes.py of solids: finite elements, constraints, contacts, bodies of many parts."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only

vec24 = wp.types.vector(24, float)
mat66 = wp.types.matrix((6, 6), float)
vec6 = wp.types.vector(6, float)


@wp.func
def hook_stress(f: wp.mat33, mu: float, lam: float):
    c = wp.determinant(f)
    cof = wp.mat33(
        wp.cross(f[1], f[2])[0], wp.cross(f[1], f[2])[1], wp.cross(f[1], f[2])[2],
        wp.cross(f[2], f[0])[0], wp.cross(f[2], f[0])[1], wp.cross(f[2], f[0])[2],
        wp.cross(f[0], f[1])[0], wp.cross(f[0], f[1])[1], wp.cross(f[0], f[1])[2],
    )  # fmt: skip
    return f * mu + cof * (lam * (c - 1.0) - mu)


@differentiable
def bricks_kernel(
    x: wp.array(dtype=wp.vec3), bricks: wp.array2d(dtype=int), inverse: wp.array(dtype=wp.mat33),
    mu: float, lam: float, f: wp.array(dtype=wp.vec3),
):  # fmt: skip
    e = wp.tid()
    i = bricks[e, 0]
    j = bricks[e, 1]
    k = bricks[e, 2]
    m = bricks[e, 3]
    shape = wp.matrix_from_cols(x[j] - x[i], x[k] - x[i], x[m] - x[i])
    d = inverse[e]
    p = hook_stress(shape * d, mu, lam)
    h = p * wp.transpose(d) * (-1.0 / (6.0 * wp.determinant(d)))
    a = wp.vec3(h[0, 0], h[1, 0], h[2, 0])
    b = wp.vec3(h[0, 1], h[1, 1], h[2, 1])
    c = wp.vec3(h[0, 2], h[1, 2], h[2, 2])
    wp.atomic_add(f, j, a)
    wp.atomic_add(f, k, b)
    wp.atomic_add(f, m, c)
    wp.atomic_sub(f, i, a + b + c)


def tetrahedra_of(n):
    """Nodes of n cells cubed, and five tetrahedra of each cell."""
    at = np.arange((n + 1) ** 3, dtype=np.int32).reshape((n + 1,) * 3)
    corner = [
        at[a : a + n, b : b + n, c : c + n].ravel() for a in (0, 1) for b in (0, 1) for c in (0, 1)
    ]
    five = ((0, 4, 2, 1), (6, 2, 4, 7), (5, 4, 1, 7), (3, 1, 2, 7), (4, 2, 1, 7))
    nodes = np.stack(np.meshgrid(*[np.arange(n + 1)] * 3, indexing="ij"), -1).reshape(-1, 3)
    return nodes / n, np.concatenate([np.stack([corner[k] for k in one], 1) for one in five])


@case
def bricks(data):
    """Forces of stable neo-Hookean tetrahedra."""
    n = data.size(16, 64)
    nodes, tets = tetrahedra_of(n)
    p = nodes[tets]
    rest = np.linalg.inv(np.stack([p[:, k] - p[:, 0] for k in (1, 2, 3)], 2))
    moved = nodes + data.random.uniform(-0.1, 0.1, nodes.shape) / n
    x = data.given(moved.astype(np.float32), wp.vec3, True)
    inverse = data.given(rest.astype(np.float32), wp.mat33, True)
    arrays = [x, data.given(tets, int), inverse, 1.0, 2.0]
    return Case(bricks_kernel, len(tets), arrays, [data.out(len(nodes), wp.vec3)], len(tets), "tet")


@forward_only
def hex_kernel(
    stiffness: wp.array2d(dtype=float), scale: wp.array3d(dtype=float), u: wp.array4d(dtype=float),
    f: wp.array4d(dtype=float),
):  # fmt: skip
    i, j, k = wp.tid()
    local = vec24()
    for c in range(8):
        for d in range(3):
            local[c * 3 + d] = u[i + c // 4, j + (c // 2) % 2, k + c % 2, d]
    s = scale[i, j, k]
    for c in range(8):
        for d in range(3):
            total = float(0.0)
            for m in range(24):
                total += stiffness[c * 3 + d, m] * local[m]
            wp.atomic_add(f, i + c // 4, j + (c // 2) % 2, k + c % 2, d, s * total)


@case
def hexes(data):
    """Elements of 24 unknowns times one stiffness, as in optimisation of topologies."""
    n = data.size(16, 96)
    k = data.real((24, 24), grad=False)
    scale, u = data.real((n, n, n), grad=False), data.real((n + 1, n + 1, n + 1, 3), grad=False)
    out = data.out((n + 1, n + 1, n + 1, 3), grad=False)
    return Case(hex_kernel, (n, n, n), [k, scale, u], [out], n**3, "element")


@forward_only
def project_kernel(
    x: wp.array(dtype=wp.vec3), w: wp.array(dtype=float), ends: wp.array2d(dtype=int),
    rest: wp.array(dtype=float), compliance: float, dt: float, multiplier: wp.array(dtype=float),
    move: wp.array(dtype=wp.vec3), count: wp.array(dtype=int),
):  # fmt: skip
    s = wp.tid()
    i = ends[s, 0]
    j = ends[s, 1]
    wi = w[i]
    wj = w[j]
    if wi + wj == 0.0:
        return
    d = x[i] - x[j]
    far = wp.length(d)
    alpha = compliance / (dt * dt)
    step = (rest[s] - far - alpha * multiplier[s]) / (wi + wj + alpha)
    multiplier[s] = multiplier[s] + step
    n = d / wp.max(far, 1.0e-6)
    wp.atomic_add(move, i, n * (step * wi))
    wp.atomic_add(move, j, n * (-step * wj))
    wp.atomic_add(count, i, 1)
    wp.atomic_add(count, j, 1)


@case
def project(data):
    """A step of extended position-based dynamics over links of a cloth."""
    n = data.size(192, 1024)
    at = np.arange(n * n).reshape(n, n)
    sides = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:]), (at[:-1, 1:], at[1:, :-1])]
    ends = np.concatenate([np.stack([a.ravel(), b.ravel()], 1) for a, b in sides])
    m = len(ends)
    w = (data.random.random(n * n) > 0.05).astype(np.float32)
    arrays = [data.real((n * n, 3), wp.vec3, grad=False), data.given(w, float)]
    arrays += [data.given(ends.astype(np.int32), int), data.real(m, grad=False), 1.0e-3, 0.01]
    outs = [data.out(m, grad=False), data.out(n * n, wp.vec3, grad=False)]
    return Case(project_kernel, m, arrays, [*outs, data.out(n * n, int, grad=False)], m, "link")


@differentiable
def spatial_kernel(
    q: wp.array2d(dtype=float), inertia: wp.array(dtype=wp.spatial_matrix),
    axis: wp.array(dtype=wp.spatial_vector), offset: wp.array(dtype=wp.transform),
    speed: wp.array(dtype=wp.spatial_vector), force: wp.array(dtype=wp.spatial_vector),
):  # fmt: skip
    i = wp.tid()
    t = wp.transform_identity()
    v = wp.spatial_vector()
    f = wp.spatial_vector()
    for j in range(q.shape[1]):
        t = t * offset[j]
        turn = wp.transform(wp.vec3(), wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), q[i, j]))
        t = t * turn
        w = wp.spatial_bottom(v)
        s = wp.spatial_vector(
            wp.transform_vector(t, wp.spatial_top(axis[j])) + wp.cross(w, wp.spatial_top(v)),
            wp.transform_vector(t, wp.spatial_bottom(axis[j])),
        )
        v = v + s * q[i, j]
        m = inertia[j] * v
        f = (
            f
            + m
            + wp.spatial_vector(wp.cross(w, wp.spatial_top(m)), wp.cross(w, wp.spatial_bottom(m)))
        )
    speed[i] = v
    force[i] = f


@case
def spatial(data):
    """Spatial speeds and forces along a chain of hinges."""
    n, m = data.size(4096, 1 << 17), 6
    offset = np.concatenate(
        [np.tile([0.3, 0.0, 0.1], (m, 1)), np.tile([0.0, 0.0, 0.0, 1.0], (m, 1))], 1
    )
    arrays = [data.real((n, m)), data.real((m, 6, 6), wp.spatial_matrix, 0.0, 0.3)]
    arrays += [data.real((m, 6), wp.spatial_vector), data.given(offset, wp.transform, True)]
    outs = [data.out(n, wp.spatial_vector), data.out(n, wp.spatial_vector)]
    return Case(spatial_kernel, n, arrays, outs, n * m, "joint")


@forward_only
def gauss_seidel_kernel(
    jacobian: wp.array3d(dtype=float), bias: wp.array2d(dtype=float), friction: float, sweeps: int,
    out: wp.array2d(dtype=float),
):  # fmt: skip
    world = wp.tid()
    rows = bias.shape[1]
    v = vec6()
    for _s in range(sweeps):
        for r in range(rows):
            total = float(bias[world, r])
            size = float(1.0e-6)
            for c in range(6):
                total += jacobian[world, r, c] * v[c]
                size += jacobian[world, r, c] * jacobian[world, r, c]
            old = out[world, r]
            new = old - total / size
            if r % 3 == 0:
                new = wp.max(new, 0.0)
            else:
                limit = friction * out[world, r - r % 3]
                new = wp.clamp(new, -limit, limit)
            out[world, r] = new
            for c in range(6):
                v[c] += jacobian[world, r, c] * (new - old)


@case
def gauss_seidel(data):
    """Contacts with friction of a body per thread, by projected Gauss-Seidel."""
    n, rows = data.size(1024, 1 << 16), 12
    arrays = [data.real((n, rows, 6), low=-1.0, grad=False)]
    arrays += [data.real((n, rows), low=-1.0, grad=False), 0.5, 4]
    return Case(gauss_seidel_kernel, n, arrays, [data.out((n, rows), grad=False)], n, "world")


@forward_only
def grains_near_kernel(
    grid: wp.uint64, x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), radius: float,
    stiff: float, damp: float, rough: float, f: wp.array(dtype=wp.vec3),
):  # fmt: skip
    t = wp.tid()
    i = wp.hash_grid_point_id(grid, t)
    p = x[i]
    total = wp.vec3()
    ground = p[1] - radius
    if ground < 0.0:
        total += wp.vec3(0.0, -stiff * ground, 0.0)
    neighbours = wp.hash_grid_query(grid, p, radius * 2.0)
    for j in neighbours:
        if j != i:
            d = p - x[j]
            far = wp.length(d)
            gap = far - radius * 2.0
            if gap <= 0.0:
                n = d / far
                rel = v[i] - v[j]
                along = wp.dot(n, rel)
                push = gap * stiff + wp.min(along, 0.0) * damp
                slip = rel - n * along
                size = wp.length(slip)
                hold = wp.min(rough * wp.abs(push), damp * size)
                total -= n * push + slip / (size + 1.0e-6) * hold
    f[i] = total


@case
def grains_near(data):
    """Contacts of grains among their neighbours in a hash grid, in the grid's order."""
    n = data.size(1 << 13, 1 << 19)
    x = data.real((n, 3), wp.vec3, grad=False)
    radius = float((0.6 / n) ** (1.0 / 3.0))
    grid = wp.HashGrid(64, 64, 64, device=data.device)
    grid.build(x, radius * 2.0)
    arrays = [grid.id, x, data.real((n, 3), wp.vec3, grad=False), radius, 100.0, 1.0, 0.5]
    outs = [data.out(n, wp.vec3, grad=False)]
    return Case(grains_near_kernel, n, arrays, outs, n, "grain", keep=grid)
