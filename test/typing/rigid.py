"""Rigid bodies: quaternions, transforms, matrices, spatial vectors, double precision."""

import math

import numpy as np

import warp as wp

mat43 = wp.types.matrix(shape=(4, 3), dtype=wp.float64)
vec5 = wp.types.vector(length=5, dtype=float)


@wp.kernel
def advance(
    q: wp.array[wp.transform],
    qd: wp.array[wp.spatial_vector],
    inertia: wp.array[wp.mat33],
    dt: float,
):
    i = wp.tid()
    pose = q[i]
    p = wp.transform_get_translation(pose)
    r = wp.transform_get_rotation(pose)
    w = wp.spatial_top(qd[i])
    v = wp.spatial_bottom(qd[i])
    body = wp.quat_rotate_inv(r, w)
    torque = -wp.cross(body, inertia[i] * body)
    w1 = w + wp.quat_rotate(r, wp.inverse(inertia[i]) * torque) * dt
    spin = wp.quat(w1[0], w1[1], w1[2], 0.0)
    r1 = wp.normalize(r + spin * r * (0.5 * dt))
    q[i] = wp.transform(p + v * dt, r1)
    qd[i] = wp.spatial_vector(w1, v)


@wp.kernel
def precise(a: wp.array[wp.vec3d], m: wp.mat33d, s: wp.float64, out: wp.array[wp.float64]):
    i = wp.tid()
    b = m * a[i]
    out[i] = wp.dot(a[i], b) * s + wp.float64(1.0)


pose = wp.transform(
    wp.vec3(0.0, 1.0, 0.0), wp.quat_from_axis_angle(wp.vec3(0.0, 1.0, 0.0), math.pi / 3)
)
bodies = wp.array([pose] * 4, dtype=wp.transform)
spatial = wp.zeros(4, dtype=wp.spatial_vector)
inertia = wp.array(np.tile(np.diag([1.0, 2.0, 3.0]), (4, 1, 1)), dtype=wp.mat33)
wp.launch(advance, dim=4, inputs=[bodies, spatial, inertia, 0.01])
point = wp.transform_point(pose, wp.vec3(1.0, 0.0, 0.0))
assert abs(point[1] - 1.0) < 1e-6
rotation = wp.quat_to_matrix(pose.q)
x: float = point.x
length: float = wp.length(point)

a = wp.array(np.eye(3), dtype=wp.vec3d)
out = wp.zeros(3, dtype=wp.float64)
m = wp.mat33d(1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0)
wp.launch(precise, dim=3, inputs=[a, m, wp.float64(2.0), out])
assert np.allclose(out.numpy(), [3.0, 5.0, 7.0])
values = vec5(1.0, 2.0, 3.0, 4.0, 5.0)
wide = mat43()
print(values, wide, rotation, x, length)
