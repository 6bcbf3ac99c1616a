"""Particles that fall on a mesh: mesh queries, a BVH, marching cubes."""

import numpy as np

import warp as wp


@wp.kernel
def push_out(mesh: wp.uint64, x: wp.array[wp.vec3], radius: float, hits: wp.array[int]):
    i = wp.tid()
    p = x[i]
    q = wp.mesh_query_point(mesh, p, 1.0)
    if q.result:
        c = wp.mesh_eval_position(mesh, q.face, q.u, q.v)
        d = p - c
        depth = wp.length(d) * q.sign - radius
        if depth < 0.0:
            n = wp.normalize(d) * q.sign
            x[i] = p - n * depth
            wp.atomic_add(hits, 0, 1)


@wp.kernel
def overlaps(bvh: wp.uint64, lower: wp.vec3, upper: wp.vec3, count: wp.array[wp.int32]):
    query = wp.bvh_query_aabb(bvh, lower, upper)
    index = int(0)
    while wp.bvh_query_next(query, index):
        wp.atomic_add(count, 0, 1)


field = np.fromfunction(
    lambda i, j, k: np.sqrt((i - 8) ** 2 + (j - 8) ** 2 + (k - 8) ** 2), (17,) * 3
)
surface = wp.MarchingCubes(17, 17, 17)
surface.surface(wp.array(field, dtype=float), 5.0)
assert surface.verts is not None and surface.indices is not None
mesh = wp.Mesh(points=surface.verts, indices=surface.indices)
points = wp.array(np.random.default_rng(1).uniform(2, 14, (1000, 3)), dtype=wp.vec3)
hits = wp.zeros(1, dtype=int)
wp.launch(push_out, dim=len(points), inputs=[mesh.id, points, 0.1, hits])

lowers = wp.array(np.zeros((4, 3)), dtype=wp.vec3)
uppers = wp.array(np.ones((4, 3)), dtype=wp.vec3)
bvh = wp.Bvh(lowers, uppers)
count = wp.zeros(1, dtype=wp.int32)
wp.launch(overlaps, dim=1, inputs=[bvh.id, wp.vec3(0.5), wp.vec3(2.0), count])
assert count.numpy()[0] == 4
print(hits.numpy()[0], "particles moved")
