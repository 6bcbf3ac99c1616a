"""A mesh, what kernels ask it, and the same in float64, for derivatives by its vertices."""

import numpy as np

import warp as wp

RANDOM = np.random.default_rng(11)
STEP = 1e-6


@wp.kernel
def closest(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=float)):
    i = wp.tid()
    q = wp.mesh_query_point_no_sign(mesh, x[i], 1.0e6)
    p = wp.mesh_eval_position(mesh, q.face, q.u, q.v)
    v = wp.mesh_eval_velocity(mesh, q.face, q.u, q.v)
    for k in range(3):
        out[i, k] = p[k]
        out[i, 5 + k] = v[k]
    out[i, 3] = q.u
    out[i, 4] = q.v


@wp.kernel
def meet(
    mesh: wp.uint64,
    start: wp.array(dtype=wp.vec3),
    dir: wp.array(dtype=wp.vec3),
    out: wp.array2d(dtype=float),
):
    i = wp.tid()
    q = wp.mesh_query_ray(mesh, start[i], dir[i], 1.0e6)
    out[i, 0] = q.t
    out[i, 1] = q.u
    out[i, 2] = q.v
    for k in range(3):
        out[i, 3 + k] = q.normal[k]


@wp.kernel
def away(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=float)):
    i = wp.tid()
    out[i, 0] = wp.mesh_sdf(mesh, x[i])


@wp.kernel
def arrays(mesh: wp.uint64, out: wp.array2d(dtype=float)):
    i = wp.tid()
    p = wp.mesh_get_point(mesh, i)
    v = wp.mesh_get_velocity(mesh, i)
    m = wp.mesh_get(mesh)
    out[i, 0] = wp.dot(p, v) + 3.0 * m.points[m.indices[i]][0]


@wp.kernel
def ask(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), face: wp.array(dtype=int)):
    i = wp.tid()
    face[i] = wp.mesh_query_point_no_sign(mesh, x[i], 1.0e6).face


def shell():
    """A closed mesh with faces in all directions: a tetrahedron, cut twice and shaken."""
    points = [[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]
    faces = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
    for _ in range(2):
        middle, cut = {}, []
        for face in faces:
            m = []
            for a, b in zip(face, (*face[1:], face[0]), strict=True):
                key = frozenset((a, b))
                if key not in middle:
                    middle[key] = len(points)
                    points.append(list(np.add(points[a], points[b]) / 2))
                m.append(middle[key])
            a, b, c = face
            cut += [(a, m[0], m[2]), (m[0], b, m[1]), (m[2], m[1], c), tuple(m)]
        faces = cut
    points = np.array(points) + 0.05 * RANDOM.standard_normal((len(points), 3))
    return points.astype(np.float32), np.array(faces)


def mesh_of(points, faces, velocities):
    return wp.Mesh(
        wp.array(points, dtype=wp.vec3, device="cpu", requires_grad=True),
        wp.array(faces.ravel(), dtype=int, device="cpu"),
        velocities=wp.array(velocities, dtype=wp.vec3, device="cpu", requires_grad=True),
    )


def foot(p, a, b, c):
    """The closest point of a triangle, its weights u and v, in the region that it is in."""
    sides = [
        (a, b, (1, 0, 0), (0, 1, 0)),
        (b, c, (0, 1, 0), (0, 0, 1)),
        (c, a, (0, 0, 1), (1, 0, 0)),
    ]
    e = np.stack([a - c, b - c])
    u, v = np.linalg.solve(e @ e.T, e @ (p - c))
    found = [] if min(u, v, 1 - u - v) < 0 else [np.array([u, v, 1 - u - v])]
    for first, second, w0, w1 in sides:
        t = np.clip((p - first) @ (second - first) / ((second - first) @ (second - first)), 0, 1)
        found.append((1 - t) * np.array(w0) + t * np.array(w1))
    feet = [w[0] * a + w[1] * b + w[2] * c for w in found]
    best = min(range(len(found)), key=lambda i: np.sum((feet[i] - p) ** 2))
    return feet[best], found[best][:2]


def hit(s, d, a, b, c):
    n = np.cross(b - a, c - a)
    t = n @ (a - s) / (n @ d)
    u, v = np.linalg.lstsq(np.stack([a - c, b - c]).T, s + t * d - c, rcond=None)[0]
    return np.array([t, u, v, *(n / np.linalg.norm(n))])


def run(kernel, mesh, inputs, columns):
    n = len(inputs[0]) if inputs else mesh.indices.size
    given = [wp.array(x, dtype=wp.vec3, device="cpu") for x in inputs]

    def launch(*_):
        out = wp.zeros((n, columns), dtype=float, device="cpu", requires_grad=True)
        wp.launch(kernel, n, [mesh.id, *given, out], device="cpu")
        return out

    return launch


def reverse(launch, weights):
    with wp.Tape() as tape:
        out = launch()
    tape.backward(grads={out: wp.array(weights, dtype=float, device="cpu")})
    return tape, out.numpy()


def differences(value, points, faces, found, weights):
    """The gradient of weighted values of faces by their corners."""
    gradient = np.zeros(points.shape)
    for i, face in enumerate(found):
        corners = points[faces[face]].astype(float)
        for k in range(9):
            step = np.zeros(9)
            step[k] = STEP
            more, less = (value(i, *(corners + s * step.reshape(3, 3))) for s in (1, -1))
            slope = weights[i] @ (more - less) / (2 * STEP)
            gradient[faces[face][k // 3], k % 3] += slope
    return gradient


def faces_of(mesh, x):
    face = wp.zeros(len(x), dtype=int, device="cpu")
    wp.launch(ask, len(x), [mesh.id, wp.array(x, dtype=wp.vec3, device="cpu"), face], device="cpu")
    return face.numpy()
