"""Debug mode checks run-time indices of components, of rows, of tiles and of a thread's arrays."""

import pytest

import warp as wp


@pytest.fixture
def debug(monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")


@wp.struct
class Held:
    v: wp.vec3
    m: wp.mat22


@wp.kernel
def read_vector(i: int, o: wp.array(dtype=float)):
    v = wp.vec3(1.0, 2.0, 3.0)
    o[0] = v[i]


@wp.kernel
def write_vector(i: int, o: wp.array(dtype=float)):
    v = wp.vec3(1.0, 2.0, 3.0)
    v[i] = 9.0
    o[0] = v[0] + v[1] + v[2]


@wp.kernel
def update_vector(i: int, o: wp.array(dtype=float)):
    v = wp.vec3(1.0, 2.0, 3.0)
    v[i] += 9.0
    o[0] = v[0] + v[1] + v[2]


@wp.kernel
def read_quaternion(i: int, o: wp.array(dtype=float)):
    q = wp.quat(1.0, 2.0, 3.0, 4.0)
    o[0] = q[i]


@wp.kernel
def read_transform(i: int, o: wp.array(dtype=float)):
    q = wp.transform(wp.vec3(1.0, 2.0, 3.0), wp.quat(0.0, 0.0, 0.0, 1.0))
    o[0] = q[i]


@wp.kernel
def read_row(i: int, o: wp.array(dtype=float)):
    m = wp.mat33(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
    r = m[i]
    o[0] = r[0]


@wp.kernel
def read_matrix(i: int, o: wp.array(dtype=float)):
    m = wp.mat22(1.0, 2.0, 3.0, 4.0)
    o[0] = m[1, i]


@wp.kernel
def write_row(i: int, o: wp.array(dtype=float)):
    m = wp.mat22(1.0, 2.0, 3.0, 4.0)
    m[i] = wp.vec2(5.0, 6.0)
    o[0] = m[0, 0]


@wp.kernel
def write_field(i: int, o: wp.array(dtype=float)):
    s = Held()
    s.m[i, 0] = 1.0
    o[0] = s.m[0, 0]


@wp.kernel
def read_local(i: int, o: wp.array(dtype=float)):
    a = wp.zeros(shape=(2, 5), dtype=float)
    o[0] = a[0, i]


@wp.kernel
def write_local(i: int, o: wp.array(dtype=float)):
    a = wp.zeros(shape=(2, 5), dtype=wp.vec2)
    a[i, 1] = wp.vec2(1.0, 2.0)
    o[0] = a[1, 1][0]


@wp.func
def chosen(v: wp.vec4, i: int):
    return v[i]


@wp.kernel
def read_in_a_function(i: int, o: wp.array(dtype=float)):
    o[0] = chosen(wp.vec4(1.0, 2.0, 3.0, 4.0), i)


@wp.kernel
def overwritten(i: int, o: wp.array(dtype=float)):
    v = wp.vec3(1.0, 2.0, 3.0)
    v[i] = 9.0
    v = wp.vec3(4.0, 5.0, 6.0)
    o[0] = v[0]


@wp.kernel
def never_read(i: int, o: wp.array(dtype=float)):
    a = wp.zeros(shape=(4,), dtype=wp.vec2)
    a[i] = wp.vec2(1.0, 2.0)
    o[0] = 1.0


@wp.func
def component(v: wp.vec3, i: float):
    return v[int(i)]


@wp.kernel
def in_a_function_of_elements(i: int, o: wp.array(dtype=float)):
    t = wp.tile_map(component, wp.tile_ones(3, dtype=wp.vec3), float(i) * wp.tile_ones(3, float))
    wp.tile_store(o, t)


@wp.kernel
def of_a_tile(i: int, o: wp.array(dtype=float)):
    t = wp.tile_ones(shape=(2, 3), dtype=wp.vec4)
    t[1, i][0] = 2.0
    o[0] = 1.0


@wp.kernel
def by_a_tile_of_indices(i: int, o: wp.array(dtype=float)):
    t = wp.tile_ones(shape=(4, 3), dtype=float)
    wp.tile_store(o, wp.tile_sum(t[:, i * wp.tile_ones(2, dtype=int)]))


CASES = [
    (read_vector, "a vector of shape (3,)", 3),
    (write_vector, "a vector of shape (3,)", 3),
    (update_vector, "a vector of shape (3,)", 3),
    (read_quaternion, "a quaternion of shape (4,)", 4),
    (read_transform, "a transform of shape (7,)", 7),
    (read_row, "a matrix of shape (3,)", 3),
    (read_matrix, "a matrix of shape (2, 2)", 2),
    (write_row, "a matrix of shape (2,)", 2),
    (write_field, "a matrix of shape (2, 2)", 2),
    (read_local, "an array of the thread of shape (5,)", 5),
    (write_local, "an array of the thread of shape (2,)", 2),
    (read_in_a_function, "a vector of shape (4,)", 4),
    (overwritten, "a vector of shape (3,)", 3),
    (never_read, "an array of the thread of shape (4,)", 4),
    (in_a_function_of_elements, "a vector of shape (3,)", 3),
    (of_a_tile, "a tile of shape (2, 3)", 3),
    (by_a_tile_of_indices, "a tile of shape (3,)", 3),
]


@pytest.mark.parametrize("kernel, what, extent", CASES, ids=lambda one: getattr(one, "key", ""))
def test_indices_of_values(device, debug, kernel, what, extent):
    o = wp.zeros(1, dtype=float, device=device)
    for index in (0, extent - 1, -1, -extent):
        wp.launch(kernel, dim=1, inputs=[index, o], device=device)
        wp.synchronize()
    for index in (extent, -extent - 1, 2**30):
        with pytest.raises(wp.WarpLaunchError) as caught:
            wp.launch(kernel, dim=1, inputs=[index, o], device=device)
            wp.synchronize()
        text = str(caught.value)
        assert f"is out of bounds for {what}" in text and f"{index}" in text, text
        assert "test_debug_indices.py" in text and f"'{kernel.key}'" in text, text


def test_code_for_a_gpu(debug):
    """Checks are in debug code, and there only."""
    text = read_vector.ir("ptx", arch=90)
    assert "warp_report" in text
    wp.config.mode = "release"
    assert "warp_report" not in read_vector.ir("ptx", arch=90)
    assert "check_index" not in read_vector.ir("thread", arch=90)
