"""`wp.launch`: arguments, dimensions, devices, and what it says when they are wrong."""

import threading

import numpy as np
import pytest

import warp as wp


@wp.kernel
def saxpy(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = a * x[i] + y[i]


@wp.kernel
def count(out: wp.array(dtype=int)):
    wp.atomic_add(out, 0, 1)


@wp.struct
class Parameters:
    scale: float
    offset: wp.vec3
    values: wp.array(dtype=float)


@wp.kernel
def use_struct(p: Parameters, out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    out[i] = p.offset * p.scale * p.values[i]


@wp.kernel
def take_values(
    i: int,
    u: wp.uint8,
    b: wp.bool,
    h: wp.float16,
    v: wp.vec3,
    m: wp.mat22,
    out: wp.array(dtype=wp.float64),
):
    out[0] = wp.float64(i)
    out[1] = wp.float64(u)
    out[2] = wp.float64(b)
    out[3] = wp.float64(h)
    out[4] = wp.float64(v[2])
    out[5] = wp.float64(m[1, 0])


@pytest.fixture
def x(device):
    return wp.array([1.0, 2.0, 3.0], dtype=float, device=device)


@pytest.fixture
def y(device):
    return wp.ones(3, device=device)


def test_inputs_and_outputs(device, x, y):
    wp.launch(saxpy, dim=3, inputs=[2.0, x, y], device=device)
    assert y.numpy().tolist() == [3, 5, 7]
    wp.launch(saxpy, 3, [2.0, x], [y], device=device)
    wp.launch(saxpy, (3,), (1,), (x, y), device=device)
    assert y.numpy().tolist() == [6, 11, 16]


@pytest.mark.parametrize(
    "dim, total",
    [(5, 5), ((5,), 5), ([2, 3], 6), ((2, 3, 4), 24), ((2, 3, 4, 5), 120), (np.int64(4), 4)],
)
def test_dimensions(device, dim, total):
    out = wp.zeros(1, dtype=int, device=device)
    wp.launch(count, dim, [out], device=device)
    assert out.numpy()[0] == total


@pytest.mark.parametrize("dim", [0, (0,), (3, 0), (0, 2, 2)])
def test_zero_threads_do_nothing(device, dim):
    out = wp.zeros(1, dtype=int, device=device)
    wp.launch(count, dim, [out], device=device)
    assert out.numpy()[0] == 0


@pytest.mark.parametrize(
    "dim", [-1, (3, -1), 2**31, (2, 2**40), (1, 1, 1, 1, 1), (), 2.5, "3", None, (2, "a")]
)
def test_bad_dimensions(device, dim):
    out = wp.zeros(1, dtype=int, device=device)
    with pytest.raises(wp.WarpLaunchError, match="count"):
        wp.launch(count, dim, [out], device=device)
    assert out.numpy()[0] == 0


def test_values_are_converted(device):
    out = wp.zeros(6, dtype=wp.float64, device=device)
    wp.launch(
        take_values,
        1,
        [np.int64(-3), wp.uint8(200), np.bool_(True), 1, (1, 2, 3), [[1, 2], [3, 4]], out],
        device=device,
    )
    assert out.numpy().tolist() == [-3, 200, 1, 1, 3, 3]
    wp.launch(
        take_values,
        1,
        [True, 7, 0, np.float32(0.5), wp.vec3(4, 5, 6), np.array([[5, 6], [7, 8]]), out],
        device=device,
    )
    assert out.numpy().tolist() == [1, 7, 0, 0.5, 6, 7]


GOOD = [1, 1, True, 1.0, wp.vec3(), wp.mat22()]


@pytest.mark.parametrize(
    "index, value",
    [
        (0, 2.5),
        (0, "1"),
        (0, None),
        (0, 2**31),
        (0, wp.float32(1.0)),
        (1, -1),
        (1, 256),
        (3, "a"),
        (3, 1e9),
        (3, wp.vec3()),
        (4, 1.0),
        (4, (1, 2)),
        (4, None),
        (4, wp.vec2()),
        (4, wp.quat()),
        (4, (1, 2, "a")),
        (5, wp.vec3()),
        (5, wp.mat33()),
    ],
)
def test_bad_values(device, index, value):
    arguments = list(GOOD)
    arguments[index] = value
    out = wp.zeros(6, dtype=wp.float64, device=device)
    name = ["i", "u", "b", "h", "v", "m"][index]
    with pytest.raises(wp.WarpLaunchError, match=f"take_values.*argument '{name}' expects"):
        wp.launch(take_values, 1, [*arguments, out], device=device)
    assert not out.numpy().any()


def test_bad_arrays(device, x, y):
    for bad, got in (
        (wp.zeros(3, dtype=wp.float64, device=device), "float64"),
        (wp.zeros(3, dtype=wp.vec3, device=device), "vec3f"),
        (wp.zeros((3, 1), device=device), "ndim=2"),
        (1.0, "float"),
        ([1.0, 2.0, 3.0], "list"),
        ("abc", "str"),
    ):
        with pytest.raises(wp.WarpLaunchError, match=f"argument 'x' expects.*float32.*{got}"):
            wp.launch(saxpy, 3, [1.0, bad, y], device=device)
    assert y.numpy().tolist() == [1, 1, 1]


def test_null_array_is_allowed(device, y):
    @wp.kernel
    def optional(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        if x.shape[0] > 0:
            out[i] = x[i]
        else:
            out[i] = 9.0

    wp.launch(optional, 3, [None, y], device=device)
    assert y.numpy().tolist() == [9, 9, 9]


@pytest.mark.parametrize("number", [0, 1, 2, 4, 10])
def test_wrong_number_of_arguments(device, x, y, number):
    arguments = ([1.0, x, y] + [y] * 10)[:number]
    with pytest.raises(wp.WarpLaunchError, match=f"expects 3 arguments.*got {number}"):
        wp.launch(saxpy, 3, arguments, device=device)


@pytest.mark.parametrize("inputs", [3.0, "abc", {"a": 1.0}])
def test_inputs_must_be_a_list(device, inputs):
    with pytest.raises(wp.WarpLaunchError):
        wp.launch(saxpy, 3, inputs, device=device)


@pytest.mark.parametrize("kernel", [None, "saxpy", lambda x: x, 3])
def test_what_is_no_kernel(device, kernel):
    with pytest.raises(wp.WarpLaunchError, match="expects a kernel"):
        wp.launch(kernel, 3, [], device=device)


@pytest.mark.parametrize("name", ["gpu", "cuda:99", 7, [1]])
def test_unknown_device(x, y, name):
    with pytest.raises(ValueError, match="no device"):
        wp.launch(saxpy, 3, [1.0, x, y], device=name)


@pytest.mark.cuda
def test_arrays_on_another_device(x, y):
    here, there = ("cpu", "cuda:0") if x.device == "cpu" else ("cuda:0", "cpu")
    with pytest.raises(wp.WarpLaunchError, match=f"'{here}'.*'{there}'"):
        wp.launch(saxpy, 3, [1.0, x, y], device=there)


def test_kernels_cannot_be_called(x, y):
    with pytest.raises(wp.WarpLaunchError, match=r"wp\.launch\(saxpy"):
        saxpy(1.0, x, y)


def test_numpy_arrays_on_the_cpu():
    x, y = np.ones(3, np.float32), np.zeros(3, np.float32)
    wp.launch(saxpy, 3, [2.0, x, y], device="cpu")
    assert y.tolist() == [2, 2, 2]
    with pytest.raises(wp.WarpLaunchError, match="argument 'x'"):
        wp.launch(saxpy, 3, [2.0, np.ones(3), y], device="cpu")


def test_structs(device):
    p = Parameters(scale=2.0, offset=(1, 2, 3))
    p.values = wp.array([1.0, 10.0], dtype=float, device=device)
    out = wp.zeros(2, dtype=wp.vec3, device=device)
    wp.launch(use_struct, 2, [p, out], device=device)
    assert out.numpy().tolist() == [[2, 4, 6], [20, 40, 60]]
    p.scale = 1.0
    p.values = p.values[1:]
    wp.launch(use_struct, 1, [p, out], device=device)
    assert out.numpy()[0].tolist() == [10, 20, 30]


@pytest.mark.parametrize("bad", [None, 1.0, (1.0, (1, 2, 3), None), wp.vec3()])
def test_bad_structs(device, bad):
    with pytest.raises(wp.WarpLaunchError, match="argument 'p' expects 'Parameters'"):
        wp.launch(use_struct, 1, [bad, wp.zeros(1, dtype=wp.vec3, device=device)], device=device)


@pytest.mark.cuda
def test_structs_with_arrays_on_another_device():
    out = wp.zeros(1, dtype=wp.vec3, device="cpu")
    p = Parameters(values=wp.zeros(1, device="cuda:0"))
    with pytest.raises(wp.WarpLaunchError, match="array on 'cuda:0'.*'cpu'"):
        wp.launch(use_struct, 1, [p, out], device="cpu")


def test_strided_arrays(device):
    base = wp.zeros((3, 2), device=device)
    x = wp.array(np.arange(6, dtype=np.float32), device=device)[::2]
    wp.launch(saxpy, 3, [1.0, x, base[:, 1]], device=device)
    assert base.numpy().tolist() == [[0, 0], [0, 2], [0, 4]]


def test_recorded_launches(device, x, y):
    command = wp.launch(saxpy, 3, [2.0, x, y], device=device, record_cmd=True)
    assert y.numpy().tolist() == [1, 1, 1]
    command.launch()
    assert y.numpy().tolist() == [3, 5, 7]
    command.set_param_by_name("a", 0.5)
    command.set_param_at_index(1, wp.ones(3, device=device))
    command.set_dim(2)
    command.launch()
    assert y.numpy().tolist() == [3.5, 5.5, 7]
    with pytest.raises(wp.WarpLaunchError, match="no parameter 'b'"):
        command.set_param_by_name("b", 1)
    with pytest.raises(wp.WarpLaunchError, match="argument 'a'"):
        command.set_param_at_index(0, "x")


def test_printing_launches(device, x, y, config, capsys):
    config.print_launches = True
    wp.launch(saxpy, 3, [1.0, x, y], device=device)
    assert capsys.readouterr().out == f"kernel: saxpy dim: 3 device: {device}\n"


def test_verifying_numbers(device, x, config):
    config.verify_fp = True
    wp.launch(saxpy, 3, [1.0, x, x], device=device)
    with pytest.raises(wp.WarpLaunchError, match="array 'y'"):
        wp.launch(saxpy, 3, [float("inf"), x, wp.zeros(3, device=device)], device=device)


@wp.struct
class Weighed:
    mass: float
    inertia: wp.mat22


@wp.kernel
def grow(out: wp.array[Weighed]):
    out[1].inertia[1, 0] += 3.0e38


def test_verifying_numbers_in_structs(device, config):
    config.verify_fp = True
    made = wp.zeros(3, dtype=Weighed, device=device)
    wp.launch(grow, 1, [made], device=device)
    with pytest.raises(wp.WarpLaunchError, match=r"the first is inf at \[1, 1, 0\].inertia"):
        wp.launch(grow, 1, [made], device=device)


def test_not_finite_numbers_pass_through(device):
    x = wp.array([np.nan, np.inf, -np.inf], dtype=float, device=device)
    y = wp.array([1.0, 1.0, np.inf], dtype=float, device=device)
    wp.launch(saxpy, 3, [1.0, x, y], device=device)
    result = y.numpy()
    assert np.isnan(result[0]) and result[1] == np.inf and np.isnan(result[2])


def test_first_launch_from_many_threads(device):
    @wp.kernel
    def add_one(out: wp.array(dtype=float)):
        wp.atomic_add(out, 0, 1.0)

    out = wp.zeros(1, device=device)
    failures = []

    def work():
        try:
            for _ in range(50):
                wp.launch(add_one, 100, [out], device=device)
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    wp.synchronize_device(device)
    assert not failures and out.numpy()[0] == 8 * 50 * 100
