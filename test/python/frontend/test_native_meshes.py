"""Meshes in native functions: queries, arrays, the box of the root, as in the kernel language."""

import numpy as np
import pytest

import warp as wp
from warp._src.kernels import native_code


@wp.struct
class Found:
    result: bool
    face: int
    sign: float
    u: float
    v: float


@wp.func_native("""
    wp::mesh_query_point_t q = way == 0   ? wp::mesh_query_point_no_sign(mesh, p, 2.0f)
                               : way == 1 ? wp::mesh_query_point(mesh, p, 2.0f)
                               : way == 2 ? wp::mesh_query_point_sign_normal(mesh, p, 2.0f)
                               : way == 3 ? wp::mesh_query_point_sign_parity(mesh, p, 2.0f)
                                          : wp::mesh_query_point_sign_winding_number(mesh, p, 2.0f);
    out[i] = {q.result, q.face, q.sign, q.u, q.v};
""")
def find(mesh: wp.uint64, p: wp.vec3, way: int, i: int, out: wp.array(dtype=Found)): ...


@wp.kernel(enable_backward=False)
def find_all(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), way: int, out: wp.array(dtype=Found)):
    i = wp.tid()
    find(mesh, p[i], way, i, out)


@wp.kernel(enable_backward=False)
def find_in_python(
    mesh: wp.uint64, p: wp.array(dtype=wp.vec3), way: int, out: wp.array(dtype=Found)
):
    i = wp.tid()
    q = wp.mesh_query_point_no_sign(mesh, p[i], 2.0)
    if way == 1:
        q = wp.mesh_query_point(mesh, p[i], 2.0)
    elif way == 2:
        q = wp.mesh_query_point_sign_normal(mesh, p[i], 2.0)
    elif way == 3:
        q = wp.mesh_query_point_sign_parity(mesh, p[i], 2.0)
    elif way == 4:
        q = wp.mesh_query_point_sign_winding_number(mesh, p[i], 2.0)
    out[i] = Found(q.result, q.face, q.sign, q.u, q.v)


@wp.func_native("""
    const wp::Mesh m = wp::mesh_get(mesh);
    int root = *m.bvh.root;
    out[0] = wp::vec3(float(m.num_points), float(m.num_tris), float(root));
    if (root < 0)
        return;
    const auto low = wp::bvh_load_node(m.bvh.node_lowers, root);
    const auto high = wp::bvh_load_node(m.bvh.node_uppers, root);
    out[1] = wp::vec3(low.x, low.y, low.z);
    out[2] = wp::vec3(high.x, high.y, high.z);
    out[3] = wp::vec3(float(low.b), m.points[m.indices[4]][0], wp::mesh_get_point(mesh, 4)[0]);
    wp::mesh_query_ray_t hit = wp::mesh_query_ray(mesh, wp::vec3(0.1f, 0.2f, 5.0f),
                                                  wp::vec3(0.0f, 0.0f, -1.0f), 10.0f, root);
    out[4] = wp::vec3(hit.t, hit.sign, hit.normal[2]);
    out[5] = wp::mesh_eval_position(mesh, hit.face, hit.u, hit.v);
""")
def describe(mesh: wp.uint64, out: wp.array(dtype=wp.vec3)): ...


@wp.kernel(enable_backward=False)
def run_describe(mesh: wp.uint64, out: wp.array(dtype=wp.vec3)):
    describe(mesh, out)


@wp.func_native("""
    float t, u, v, sign;
    wp::vec3 n;
    bool hit = wp::intersect_ray_tri_woop(p, d, a, b, c, t, u, v, sign, &n);
    return hit ? wp::vec4(t, u, v, sign * n[2]) : wp::vec4(-1.0f, 0.0f, 0.0f, 0.0f);
""")
def meet(p: wp.vec3, d: wp.vec3, a: wp.vec3, b: wp.vec3, c: wp.vec3) -> wp.vec4: ...


@wp.kernel(enable_backward=False)
def run_meet(p: wp.array(dtype=wp.vec3), d: wp.vec3, out: wp.array(dtype=wp.vec4)):
    i = wp.tid()
    a, b, c = wp.vec3(0.0, 0.0, 0.0), wp.vec3(4.0, 0.0, 0.0), wp.vec3(0.0, 2.0, 0.0)
    out[i] = meet(p[i], d, a, b, c)


def box(device):
    corners = [[x, y, z] for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0)]
    faces = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1]
    faces += [2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
    points = wp.array(corners, dtype=wp.vec3, device=device)
    indices = wp.array(faces, dtype=int, device=device)
    return wp.Mesh(points, indices, support_winding_number=True)


@pytest.mark.parametrize("way", range(5))
def test_closest_points(native_device, way):
    mesh = box(native_device)
    p = np.random.default_rng(way).uniform(-4.0, 4.0, (50, 3))
    points, n = wp.array(p, dtype=wp.vec3), len(p)
    native, python = wp.zeros(n, dtype=Found), wp.zeros(n, dtype=Found)
    wp.launch(find_all, n, [mesh.id, points, way, native])
    wp.launch(find_in_python, n, [mesh.id, points, way, python])
    assert np.array_equal(native.numpy(), python.numpy())
    inside = np.all(np.abs(p) < [1.0, 2.0, 3.0], axis=1)
    found = native.numpy()["result"]
    signs = np.where(inside, -1.0, 1.0) if way else 0.0
    assert found.any() and np.array_equal(native.numpy()["sign"], np.where(found, signs, 0.0))


def test_arrays_and_root(native_device):
    mesh, out = box(native_device), wp.zeros(6, dtype=wp.vec3)
    wp.launch(run_describe, 1, [mesh.id, out])
    expected = [[8, 12, 0], [-1, -2, -3], [1, 2, 3], [1, -1, -1], [2, 1, 1], [0.1, 0.2, 3]]
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-6)


def test_a_mesh_that_is_gone(native_device):
    mesh, out = box(native_device), wp.zeros(6, dtype=wp.vec3)
    number = mesh.id
    del mesh
    wp.launch(run_describe, 1, [number, out])
    assert out.numpy()[0].tolist() == [0, 0, -1]


def test_rays_and_triangles(native_device):
    """Also along an edge and through a corner, where neighbours must not both miss."""
    starts = [[1, 0.5, 3], [3, 1.5, 3], [2, 0, 3], [0, 0, 3], [1, 0.5, -3], [2, 1, 3]]
    p, out = wp.array(starts, dtype=wp.vec3), wp.zeros(6, dtype=wp.vec4)
    wp.launch(run_meet, 6, [p, wp.vec3(0.0, 0.0, -2.0), out])
    expected = [[1.5, 0.5, 0.25], [-1, 0, 0], [1.5, 0.5, 0.5], [1.5, 1, 0], [-1, 0, 0]]
    expected.append([1.5, 0.0, 0.5])
    np.testing.assert_allclose(out.numpy()[:, :3], expected, atol=1e-6)


def test_code_for_gpus_has_the_library():
    if not native_code.compiler(gpu=True):
        pytest.skip("no NVRTC")
    for kernel in (find_all, run_describe):
        ptx = kernel.ir("ptx", arch=90)
        assert ".extern .func warp_" not in ptx
        assert ("warp_mesh_ray(" in ptx) == (kernel is run_describe)
