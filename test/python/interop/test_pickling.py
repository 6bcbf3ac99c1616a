"""Pickles of every public class, loaded in a fresh process."""

import pickle
import subprocess
import sys
import types

import numpy as np
import pytest

import programs
import warp as wp

wp.config.quiet = True
OFFSET = 0.5


@wp.struct
class Body:
    position: wp.vec3
    mass: float


@wp.struct
class Cloud:
    inner: Body
    points: wp.array(dtype=wp.vec3)
    weights: wp.types.vector(5, float)


@wp.func
def shifted(x: float):
    return x + OFFSET


@wp.kernel
def shift(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = shifted(x[i])


def power_kernel(power):
    @wp.kernel
    def raised(x: wp.array(dtype=float)):
        i = wp.tid()
        r = float(1.0)
        for _ in range(power):
            r = r * x[i]
        x[i] = r + wp.static(float(power))

    return raised


# The child has no module of this test's name, so that what it loads has to bring all with it.
CHILD = """
import pickle, sys
import numpy as np
value = pickle.loads(sys.stdin.buffer.read())
import warp as wp
wp.config.quiet = True
{code}
"""


def in_child(value, code, dumps=pickle.dumps):
    """Runs code in a fresh process, in which `value` is the unpickled copy."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD.format(code=code)],
        input=dumps(value),
        capture_output=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return done.stdout.decode().strip()


def picklers():
    found = [pytest.param(pickle.dumps, id="pickle")]
    try:
        import cloudpickle
    except ImportError:
        skipped = pytest.mark.skip(reason="cloudpickle is not installed")
        return [*found, pytest.param(None, id="cloudpickle", marks=skipped)]
    return [*found, pytest.param(cloudpickle.dumps, id="cloudpickle")]


@pytest.fixture(params=picklers())
def dumps(request):
    return request.param


def all_values():
    points = wp.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=wp.vec3, device="cpu")
    cloud = Cloud()
    cloud.points, cloud.inner.mass = points, 2.0
    return {
        "strided": wp.array(np.arange(12.0).reshape(3, 4), dtype=float, device="cpu")[:, 1],
        "half": wp.array([1.0, 2.0], dtype=wp.float16, device="cpu"),
        "empty": wp.zeros((0, 3), dtype=wp.vec3, device="cpu"),
        "structs": wp.zeros(2, dtype=Body, device="cpu"),
        "indexed": points[wp.array([2, 0], dtype=int, device="cpu")],
        "values": [wp.vec3(1.0, 2.0, 3.0), wp.quat_identity(), wp.mat22(1.0, 2.0, 3.0, 4.0)],
        "types": [wp.vec3, wp.types.vector(5, float), wp.types.matrix((12, 3), wp.float64)],
        "annotation": wp.array(dtype=Body, ndim=2),
        "classes": [Body, Cloud],
        "cloud": cloud,
        "mesh": wp.Mesh(points, wp.array([0, 1, 2], dtype=int, device="cpu")),
        "bvh": wp.Bvh(points, points),
        "grid": wp.HashGrid(4, 5, 6, device="cpu"),
        "volume": wp.Volume.load_from_numpy(np.ones((4, 4, 4), np.float32), device="cpu"),
        "texture": wp.Texture2D(np.eye(4, dtype=np.float32), device="cpu"),
        "device": wp.get_device("cpu"),
        "builtin": wp.sin,
        "config": wp.config,
    }


CHECKS = """
assert np.array_equal(value["strided"].numpy(), [1, 5, 9]) and value["strided"].is_contiguous
assert value["half"].dtype is wp.float16 and value["half"].list() == [1.0, 2.0]
assert value["empty"].shape == (0, 3) and value["empty"].dtype is wp.vec3
assert value["structs"].numpy()["mass"].tolist() == [0, 0]
assert value["indexed"].numpy().tolist() == [[0, 1, 0], [0, 0, 0]]
assert value["values"] == [wp.vec3(1., 2., 3.), wp.quat_identity(), wp.mat22(1., 2., 3., 4.)]
assert value["types"] == [wp.vec3, wp.types.vector(5, float), wp.types.matrix((12, 3), wp.float64)]
assert repr(value["annotation"]) == "wp.array2d[Body]"
Body, Cloud = value["classes"]
assert list(Cloud.vars) == ["inner", "points", "weights"] and Body().mass == 0.0
assert type(value["cloud"]).__name__ == "Cloud" and value["cloud"].inner.mass == 2.0
assert value["cloud"].points.numpy()[1].tolist() == [1, 0, 0]
assert value["mesh"].points.shape == (3,) and value["mesh"].id and value["bvh"].id
assert value["grid"].id and value["volume"].array().size > 1000 and value["texture"].width == 4
assert value["device"] is wp.get_device("cpu") and value["builtin"] is wp.sin
assert value["config"] is wp.config
"""


def test_values_come_back_in_another_process(dumps):
    in_child(all_values(), CHECKS, dumps)


def checker():
    """A function of the main module, which cloudpickle sends by value."""
    body = "".join(f"    {line}\n" for line in CHECKS.strip().splitlines())
    names = {"__name__": "__main__"}
    header = "def check(value):\n    import numpy as np, warp as wp\n    wp.config.quiet = True\n"
    exec(f"{header}{body}    return 'all right'\n", names)
    return names["check"]


def test_values_travel_through_ray():
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=1, include_dashboard=False, log_to_driver=False, logging_level="error")
    try:
        value = ray.put(all_values())
        assert ray.get(ray.remote(checker()).remote(value), timeout=120) == "all right"
    finally:
        ray.shutdown()


def test_values_travel_through_dask():
    dask = pytest.importorskip("dask")
    value = dask.delayed(all_values(), name="value", traverse=False)
    task = dask.delayed(checker())(value)
    assert task.compute(scheduler="processes", num_workers=1) == "all right"


def test_gradients_travel_with_their_arrays(dumps):
    x = wp.array([1.0, 2.0], dtype=float, device="cpu", requires_grad=True)
    x.grad.fill_(3.0)
    code = "assert value.requires_grad and value.grad.list() == [3.0, 3.0]"
    in_child(x, code, dumps)


def test_kernels_launch_where_their_module_is_absent(dumps):
    code = """
x = wp.full(2, 2.0, dtype=float, device="cpu")
for kernel in value:
    wp.launch(kernel, 2, [x], device="cpu")
print(x.list())
"""
    # 2 + 0.5, then 2.5 ** 3 + 3.
    shift.__module__ = shifted.__module__ = "__main__"
    try:
        assert in_child([shift, power_kernel(3)], code, dumps) == "[18.625, 18.625]"
    finally:
        shift.__module__ = shifted.__module__ = __name__


def test_kernels_of_modules_are_themselves():
    assert pickle.loads(pickle.dumps(shift)) is shift
    assert pickle.loads(pickle.dumps(shifted)) is shifted
    assert pickle.loads(pickle.dumps(Body)) is Body


def test_missing_modules_are_named():
    data = pickle.dumps(shift).replace(__name__.encode(), b"x" * len(__name__))
    with pytest.raises(pickle.UnpicklingError, match="put the module on the path") as caught:
        pickle.loads(data)
    assert "'shift'" in str(caught.value)


def test_sparse_matrices_come_back():
    from warp import sparse

    rows, columns = (wp.array(one, dtype=int, device="cpu") for one in ([0, 1, 1], [2, 0, 1]))
    for dtype, values in ((float, np.arange(3.0)), (wp.mat22, np.arange(12.0).reshape(3, 2, 2))):
        blocks = wp.array(values, dtype=dtype, device="cpu")
        matrix = sparse.bsr_from_triplets(2, 3, rows, columns, blocks)
        found = pickle.loads(pickle.dumps(matrix))
        assert type(found) is type(matrix) and found.values.ptr != matrix.values.ptr
        for name in ("offsets", "columns", "values"):
            assert getattr(found, name).numpy().tolist() == getattr(matrix, name).numpy().tolist()
        assert (found.nrow, found.ncol, found.nnz) == (2, 3, 3)


def test_public_names_are_themselves():
    """Classes, functions and integrands of all modules travel by name; so does all else."""
    import warp.fem

    named = type, types.FunctionType, warp.fem.Integrand
    for module in (wp, wp.types, wp.optim, wp.utils, wp.autograd, wp.fem):
        for name in dir(module):
            value = getattr(module, name)
            if not name.startswith("_") and not isinstance(value, types.ModuleType):
                found = pickle.loads(pickle.dumps(value))
                same = found is value or not isinstance(value, named)
                assert same and type(found) is type(value), (module.__name__, name)


def test_pickles_of_another_version_say_so():
    data = pickle.dumps(wp.zeros(2, dtype=float, device="cpu")).replace(
        b"load_array", b"load_arrow"
    )
    with pytest.raises(pickle.UnpicklingError, match=r"'load_arrow': load the pickle with"):
        pickle.loads(data)


def test_arrays_of_an_absent_device_come_to_the_default_one(tmp_path):
    driver = programs.FAKE_CUDA
    if not driver.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    text = """
import pickle, sys
import warp as wp
x = wp.array([1.0, 2.0], dtype=float, device="cuda:1")
open(sys.argv[1], "wb").write(pickle.dumps(x))
"""
    file = tmp_path / "x.pickle"
    status, _, err = programs.run(programs.write_program(text), file, WARP_CUDA_DRIVER=driver)
    assert status == 0, err
    if wp.get_cuda_device_count() < 2:
        found = pickle.loads(file.read_bytes())
        assert found.device == wp.get_device() and found.list() == [1.0, 2.0]


def test_buffers_travel_out_of_band():
    x = wp.array(np.arange(1000.0), dtype=float, device="cpu")
    buffers = []
    data = pickle.dumps(x, protocol=5, buffer_callback=buffers.append)
    assert len(data) < 400 and len(buffers) == 1
    memory = bytes(buffers[0].raw())
    y = pickle.loads(data, buffers=[memory])
    assert y.read_only and np.array_equal(x.numpy(), y.numpy())
    assert y.ptr == np.frombuffer(memory, np.uint8).ctypes.data
    y = pickle.loads(data, buffers=[bytearray(memory)])
    y.fill_(1.0)
    assert not y.read_only and y.numpy().sum() == 1000 and x.numpy()[2] == 2


def test_graphs_travel_as_saved(dumps):
    x = wp.full(2, 2.0, dtype=float, device="cpu")
    with wp.ScopedCapture(device="cpu", apic=True) as capture:
        wp.launch(shift, 2, [x], device="cpu")
    in_child(capture.graph, "wp.capture_launch(value)", dumps)


def test_what_stays_in_its_process_says_what_to_send():
    x = wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(shift, 2, [x], device="cpu")
    with wp.ScopedCapture(device="cpu") as capture:
        x.fill_(1.0)
    for value, words in ((tape, "send arrays and gradients"), (capture.graph, "apic=True")):
        with pytest.raises(TypeError, match=words):
            pickle.dumps(value)
    holders = wp.zeros(1, dtype=Cloud, device="cpu")
    with pytest.raises(TypeError, match="elements hold arrays"):
        pickle.dumps(holders)
