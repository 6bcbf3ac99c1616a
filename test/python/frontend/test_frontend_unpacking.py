"""Stars in calls, tuple parameters, reversed ranges, captured and empty structs."""

import numpy as np
import pytest

import warp as wp

SHADOWED = 999
thread_index = wp.tid


@wp.func
def weigh(a: float, b: float, c: float):
    return a + 10.0 * b + 100.0 * c


def test_stars(device):
    @wp.kernel
    def kernel(x: wp.array(dtype=float), m: wp.array2d(dtype=float), out: wp.array(dtype=float)):
        v = wp.vec4(1.0, 2.0, 3.0, 4.0)
        out[0] = weigh(*x[1:4])
        out[1] = weigh(*x[0:6:2])
        out[2] = weigh(*m[1][0:3])
        out[3] = weigh(*v[1:])
        out[4] = wp.vec4(x[5], *x[:3])[1]

    x = wp.array(range(6), dtype=float, device=device)
    m = wp.array([[0, 1, 2], [3, 4, 5]], dtype=float, device=device)
    out = wp.zeros(5, dtype=float, device=device)
    wp.launch(kernel, 1, [x, m, out], device=device)
    assert out.numpy().tolist() == [321.0, 420.0, 543.0, 432.0, 0.0]


def test_stars_need_bounds_known_at_compile_time():
    def whole(x: wp.array(dtype=float)):
        weigh(*x)

    def dynamic(x: wp.array(dtype=float), n: int):
        weigh(*x[0:n])

    def endless(x: wp.array(dtype=float)):
        weigh(*x[1:])

    def negative(x: wp.array(dtype=float)):
        weigh(*x[-3:3])

    for body, fragment in (
        (whole, "known at compile time"),
        (dynamic, "known at compile time"),
        (endless, "expects bounds of at least 0 and an end"),
        (negative, "expects bounds of at least 0 and an end"),
    ):
        with pytest.raises(wp.WarpCodegenError, match=fragment):
            wp.Kernel(body).prepare()


def test_tuple_parameters(device):
    @wp.func
    def total(parts: tuple[float, ...]):
        s = float(0.0)
        for i in range(len(parts)):
            s += parts[i]
        return s

    @wp.func
    def pair(parts: tuple[int, float]):
        return float(parts[0]) - parts[1]

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = total((1.0, 2.0, 4.0))
        out[1] = total((8.0,))
        out[2] = pair((5, 0.5))

    out = wp.zeros(3, dtype=float, device=device)
    wp.launch(kernel, 1, [out], device=device)
    assert out.numpy().tolist() == [7.0, 8.0, 4.5]

    def swapped():
        pair((0.5, 5))

    def mixed():
        total((0.5, 5))

    for body in (swapped, mixed):
        with pytest.raises(wp.WarpCodegenTypeError, match="argument 'parts' does not take"):
            wp.Kernel(body).prepare()


@pytest.mark.parametrize(
    "bounds", [(0, 10, 3), (10, 0, -3), (0, 0, 2), (5, 1, 2), (1, 11, 5), (-7, 8, 4), (3, -9, -1)]
)
def test_reversed_dynamic_range(device, bounds):
    @wp.kernel
    def kernel(low: int, high: int, step: int, out: wp.array(dtype=int)):
        n = int(0)
        for i in reversed(range(low, high, step)):
            out[n] = i
            n += 1
        out[49] = n

    out = wp.zeros(50, dtype=int, device=device)
    wp.launch(kernel, 1, [*bounds, out], device=device)
    expected = list(range(*bounds))[::-1]
    found = out.numpy().tolist()
    assert found[: len(expected)] == expected
    assert found[49] == len(expected)


def test_fields_of_captured_structs_keep_their_type(device):
    @wp.struct
    class Constants:
        a: wp.float64
        b: wp.uint64
        v: wp.vec3

    constants = Constants(a=0.1, b=2**63 + 1, v=wp.vec3(1.0, 2.0, 3.0))

    @wp.kernel
    def kernel(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.uint64)):
        x[0] = constants.a
        y[0] = constants.b
        x[1] = wp.float64(constants.v[1])

    x = wp.zeros(2, dtype=wp.float64, device=device)
    y = wp.zeros(1, dtype=wp.uint64, device=device)
    wp.launch(kernel, 1, [x, y], device=device)
    assert x.numpy().tolist() == [0.1, 2.0]
    assert y.numpy().tolist() == [2**63 + 1]


def test_empty_structs(device):
    @wp.struct
    class Empty:
        pass

    @wp.struct
    class Outer:
        nothing: Empty
        x: float

    @wp.kernel
    def kernel(nothing: Empty, outer: Outer, out: wp.array(dtype=float)):
        other = Empty()  # noqa: F841
        out[0] = outer.x

    out = wp.zeros(1, dtype=float, device=device)
    wp.launch(kernel, 1, [Empty(), Outer(x=4.0), out], device=device)
    assert out.numpy().tolist() == [4.0]


def test_rows_of_a_matrix(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=wp.mat22)):
        m = wp.mat22(1.0, 2.0, 3.0, 4.0)
        out[0] = wp.matrix_from_cols(*m)

    out = wp.zeros(1, dtype=wp.mat22, device=device)
    wp.launch(kernel, 1, [out], device=device)
    assert out.numpy()[0].tolist() == [[1.0, 3.0], [2.0, 4.0]]


def test_extents_of_types_and_values(device):
    @wp.kernel
    def kernel(a: wp.array(dtype=wp.vec3d), out: wp.array(dtype=wp.float64)):
        kind = a.dtype
        out[0] = kind.dtype(kind.length) * a[0][1]
        v = wp.vec4()
        m = wp.types.matrix(shape=(2, 3), dtype=float)()
        out[1] = wp.float64(v.length + 10 * m.shape[1])
        q = wp.quat()
        out[2] = wp.float64(wp.static(len(v) + 10 * len(q) + 100 * len(m)))

    a = wp.array([[1.0, 0.5, 2.0]], dtype=wp.vec3d, device=device)
    out = wp.zeros(3, dtype=wp.float64, device=device)
    wp.launch(kernel, 1, [a, out], device=device)
    assert out.numpy().tolist() == [1.5, 34.0, 244.0]


def test_static_unrolls_long_loops(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        s = int(0)
        for i in range(40):
            s += wp.static(i * i)
        for i in range(True):
            s += i + 1
        out[0] = s

    out = wp.zeros(1, dtype=int, device=device)
    wp.launch(kernel, 1, [out], device=device)
    assert out.numpy()[0] == sum(i * i for i in range(40)) + 1


def test_static_expressions_know_no_components():
    def components(v: wp.vec2):
        wp.expect_eq(wp.static(v[0]), 1.0)

    with pytest.raises(wp.WarpCodegenError, match="static expression failed"):
        wp.Kernel(components).prepare()


def test_loops_stay_loops_where_static_expressions_do_not_vary(device):
    """A body that asks for settings is said once; one that asks for what the loop changes, each
    time."""
    doubles, count = True, 40

    @wp.kernel
    def settled(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        total = float(0.0)
        for i in range(count):
            if wp.static(doubles):
                total += 2.0 * x[i]
            else:
                total += x[i]
            if total > 100.0:
                break
        out[0] = total

    @wp.kernel
    def varying(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        total = float(0.0)
        for i in range(count):
            total += x[i] * wp.static(float(3 * i))
        out[0] = total

    x = np.linspace(0.5, 3.0, count).astype(np.float32)
    sums = np.cumsum(2.0 * x.astype(np.float64))
    expected = {settled: sums[np.argmax(sums > 100.0)], varying: x @ (3.0 * np.arange(count))}
    for kernel, value in expected.items():
        out = wp.zeros(1, dtype=float, device=device)
        wp.launch(kernel, 1, inputs=[wp.array(x, device=device)], outputs=[out], device=device)
        np.testing.assert_allclose(out.numpy()[0], value, rtol=1e-6)
    assert settled.ir("warp").count("warp.load") == 1
    assert varying.ir("warp").count("warp.load") == count


def test_names_of_loops_hide_globals_in_static_expressions():
    def hidden(n: int, out: wp.array(dtype=int)):
        SHADOWED = n
        out[0] = wp.static(SHADOWED)

    with pytest.raises(wp.WarpCodegenError, match="static expression failed: name 'SHADOWED'"):
        wp.Kernel(hidden).prepare()


def test_a_function_defined_again_leaves_other_names_alone(device):
    @wp.func
    def number():
        return 17

    first = number

    @wp.func
    def number():
        return 42

    @wp.kernel
    def kernel(out: wp.array(dtype=int)):
        out[0] = first()
        out[1] = number()

    out = wp.zeros(2, dtype=int, device=device)
    wp.launch(kernel, 1, [out], device=device)
    assert out.numpy().tolist() == [17, 42]
    assert (first(), number()) == (17, 42)


def test_vectors_of_truth_values(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=bool)):
        v = wp.vector(True, False, True)
        out[0] = v[0] and not v[1]
        out[1] = wp.static(len(wp.transform())) == 7

    out = wp.zeros(2, dtype=bool, device=device)
    wp.launch(kernel, 1, [out], device=device)
    assert out.numpy().tolist() == [True, True]


def test_thread_indices_by_other_names(device):
    """`wp.tid` gives as many indices as there are names, whatever it is called."""

    @wp.kernel
    def by_global(out: wp.array2d(dtype=int)):
        i, j = thread_index()
        out[i, j] = 3 * i + j

    @wp.kernel
    def by_local(out: wp.array2d(dtype=int)):
        if SHADOWED:
            first = wp.tid
        second = first
        i, j = second()
        out[i, j] = 3 * i + j

    @wp.func
    def pair():
        return 2, 1

    @wp.kernel
    def of_function(out: wp.array2d(dtype=int)):
        i, j = pair()
        out[i, j] = 3 * i + j

    for kernel, expected in ((by_global, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]),
                             (by_local, [[0, 1, 2], [3, 4, 5], [6, 7, 8]]),
                             (of_function, [[0, 0, 0], [0, 0, 0], [0, 7, 0]])):  # fmt: skip
        out = wp.zeros((3, 3), dtype=int, device=device)
        wp.launch(kernel, (3, 3), [out], device=device)
        assert out.numpy().tolist() == expected
