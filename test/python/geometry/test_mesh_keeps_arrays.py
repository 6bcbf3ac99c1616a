"""The arrays that kernels reach through a mesh live as long as they are reached."""

import gc

import numpy as np

import warp as wp


@wp.kernel
def corner(mesh: wp.uint64, result: wp.array(dtype=wp.vec3)):
    result[0] = wp.mesh_eval_position(mesh, 1, 0.0, 0.0)


def test_replaced_indices_do_not_free_those_in_use(device):
    """Until the mesh is refitted queries see the array that it was built with."""
    points = np.arange(27.0, dtype=np.float32).reshape(9, 3)
    faces = [0, 1, 2, 3, 4, 5, 6, 7, 8]
    mesh = wp.Mesh(
        wp.array(points, dtype=wp.vec3, device=device), wp.array(faces, dtype=int, device=device)
    )
    result = wp.zeros(1, dtype=wp.vec3, device=device)
    mesh.indices = wp.array(faces[::-1], dtype=int, device=device)
    gc.collect()
    others = [wp.full(9, 7, dtype=int, device=device) for _ in range(50)]
    wp.launch(corner, 1, [mesh.id, result], device=device)
    # With u = v = 0 it is the third corner of the face.
    np.testing.assert_array_equal(result.numpy()[0], points[5])
    assert all((one.numpy() == 7).all() for one in others)
    mesh.refit()
    wp.launch(corner, 1, [mesh.id, result], device=device)
    np.testing.assert_array_equal(result.numpy()[0], points[3])
