"""Names and types of NVIDIA Warp beside kernels that are right."""

import gc
import typing
import weakref

import numpy as np
import pytest

import warp as wp


@pytest.fixture(autouse=True)
def peer_messages(monkeypatch):
    monkeypatch.setattr(wp.config, "peer_messages", True)


@wp.kernel
def any_rank(x: wp.array[float, typing.Any], y: wp.array(dtype=float)):
    y[0] = float(x.shape[0])


def test_arrays_of_any_rank(device):
    y = wp.zeros(1, dtype=float, device=device)
    for shape in ((3,), (5, 2), (7, 1, 2)):
        wp.launch(any_rank, 1, [wp.zeros(shape, dtype=float, device=device), y], device=device)
        assert y.numpy()[0] == shape[0]
    assert len(any_rank.overloads) == 3
    annotation = wp.array[float, typing.Any]
    assert annotation.ndim is typing.Any and repr(annotation) == "wp.array[wp.float32, Any]"
    with pytest.raises(ValueError, match="ndim must be between"):
        wp.array[float, 5]
    with pytest.raises(TypeError, match="single type parameter"):
        wp.array2d[float, 2]
    assert wp.array3d([[1.0, 2.0]], dtype=float, device="cpu").shape == (1, 2)
    with pytest.raises(ValueError, match="expects 3 dimensions"):
        wp.array3d(shape=(1, 2), dtype=float, device="cpu")
    rank, length = typing.TypeVar("rank"), typing.TypeVar("length", bound=int)
    assert typing.get_origin(wp.types.Vector[rank, length]) is wp.types.Vector


def test_tiles_with_open_shapes():
    assert wp.tile[float].shape is typing.Any and wp.tile[float, 4].storage == "register"


@wp.func
def apply(f: wp.Function, x: float):
    return f(x)


@wp.func
def third(x: wp.float64):
    return x / wp.float64(3.0)


def test_functions_refuse_other_arguments_in_python():
    assert apply(wp.sin, 0.0) == 0.0
    for call in (lambda: apply(lambda x: x, 1.0), lambda: third(1.0)):
        with pytest.raises(RuntimeError, match="^Error calling function .*, no overload found"):
            call()
    with pytest.raises(RuntimeError, match=r"^Couldn't find a function 'mul' compatible with the"):
        wp.mat22() * wp.mat22d()
    assert wp.invert(-1234567890123456789) == wp.invert(wp.int32(-1234567890123456789))
    state, place = wp.rand_init(42), wp.vec3(0.25, 0.5, 0.75)
    assert wp.curlnoise(xyz=place, state=state) == wp.curlnoise(state, place)


def test_references_alone_tell_no_overloads_apart():
    @wp.func
    def same(x: int):
        return x

    with pytest.raises(RuntimeError, match="differ only by references"):

        @wp.func
        def same(x: wp.ref[int]):
            x += 1


def test_numpy_types():
    assert np.dtype(wp.bfloat16) == np.dtype(object) and np.dtype(wp.float16) == np.float16
    assert np.dtype(wp.uint8(3)) == np.uint8
    if np.lib.NumpyVersion(np.__version__) >= "2.4.0":
        assert not hasattr(wp.float32, "dtype")


@pytest.mark.parametrize(
    "value, words",
    [
        ("wp.vec3d(1.0, 2.0, 3.0)", "vector is expected to be of length 3 with dtype float32."),
        ("wp.float64(5.0)", "value is expected to be a vector of length 3, with dtype float32."),
        ("wp.mat22(1.0, 2.0, 3.0, 4.0)", "value is expected to be a vector of length 3"),
        ("wp.vec2(5.0, 6.0)", r"The length of the provided vector \(2\) isn't compatible"),
    ],
)
def test_slices_of_other_types(value, words, tmp_path):
    body = f"@wp.kernel\ndef cut():\n    v = wp.vec4()\n    v[1:] = {value}\n"
    text = f"import warp as wp\n\n\n{body}"
    (tmp_path / "cut.py").write_text(text)
    space: dict = {"__name__": "cut"}
    exec(compile(text, str(tmp_path / "cut.py"), "exec"), space)
    with pytest.raises(ValueError, match=words):
        wp.launch(space["cut"], 1, device="cpu")


def test_parts_of_elements_of_other_types():
    @wp.kernel(module="unique")
    def mixed(y: wp.array(dtype=wp.vec3)):
        y[0].y = y[0]

    with pytest.raises(TypeError, match="Composite slot assignment expects value of type float32"):
        wp.launch(mixed, 1, [wp.zeros(1, dtype=wp.vec3, device="cpu")], device="cpu")


def test_errors_do_not_keep_kernels():
    @wp.kernel(module="unique")
    def wrong(y: wp.array(dtype=float)):
        y[0] = None

    kept, known = [], weakref.ref(wrong)
    try:
        wp.launch(wrong, 1, [wp.zeros(1, dtype=float, device="cpu")], device="cpu")
    except RuntimeError as problem:
        kept.append(problem)
    assert "expects a value, but got 'None'" in str(kept[0])
    del wrong
    gc.collect()
    assert known() is None


def test_a_tape_that_was_reset_knows_its_gradients(device):
    x = wp.ones(3, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        y = x * x
    tape.backward(grads={y: wp.ones(3, dtype=float, device=device)})
    tape.reset()
    assert not tape.launches and tape.gradients[x] is x.grad
    np.testing.assert_array_equal(x.grad.numpy(), 0.0)


@wp.kernel
def literals(values: wp.array(dtype=wp.float64)):
    x = 0.1
    d = wp.vec3d(x, 0.0, 0.0)
    values[0] = d[0]
    values[1] = wp.float64(x)
    x += 0.1
    values[2] = wp.float64(x)


def test_literals_in_variables_keep_their_digits(device):
    """As written where a variable is converted; after arithmetic it is a float32."""
    values = wp.zeros(3, dtype=wp.float64, device=device)
    wp.launch(literals, 1, [values], device=device)
    assert values.numpy().tolist() == [0.1, 0.1, float(np.float32(0.1) + np.float32(0.1))]


def test_static_expressions_that_stand_alone():
    class Mine:
        pass

    for value, words in (
        (wp.zeros(3, device="cpu"), "a Warp array cannot be created"),
        (None, "None is returned"),
        (Mine(), "value of type .*Mine"),
    ):

        @wp.kernel(module="unique")
        def alone():
            wp.static(value)  # noqa: B023

        with pytest.raises(RuntimeError, match=f"unsupported value: {words}"):
            wp.launch(alone, 1, device="cpu")


class Tagged(wp.array):
    """An array of somebody's own class."""


def test_arrays_of_derived_classes_are_no_annotations():
    one = Tagged([1.0], dtype=float, device="cpu")

    def body(a):
        pass

    body.__annotations__["a"] = one
    Fields = type("Fields", (), {"__annotations__": {"a": one}})
    for decorator, decorated in ((wp.kernel, body), (wp.func, body), (wp.struct, Fields)):
        with pytest.raises(TypeError, match="'a' of .* has an array of 'Tagged' as its annotation"):
            decorator(decorated)
    with pytest.raises(TypeError, match="Subscript syntax not supported"):
        Tagged[float]


@wp.kernel
def counters(results: wp.array(dtype=int)):
    for n in range(2):
        for n in range(3):  # noqa: B007
            pass
        results[wp.static(n)] += 1


def test_static_expressions_see_the_counter_that_a_loop_left():
    results = wp.zeros(3, dtype=int, device="cpu")
    wp.launch(counters, 1, [results], device="cpu")
    assert results.numpy().tolist() == [0, 0, 2]


def test_keys_of_caches_tell_processors_apart(monkeypatch):
    native = wp.get_cpu_kernel_cache_key(cpu_compiler_flags="-march=native")
    assert native != wp.get_cpu_kernel_cache_key(cpu_compiler_flags="")
    assert native == wp.get_cpu_kernel_cache_key(cpu_compiler_flags="-O2 -march=native")
    assert native == wp.get_cpu_kernel_cache_key()
    monkeypatch.setattr(wp.config, "cpu_compiler_flags", "")
    assert native != wp.get_cpu_kernel_cache_key()


def test_codes_of_types():
    from warp._src.compat.type_names import get_type_code

    known = {
        "v3f4": wp.vec3,
        "m23f8": wp.types.matrix((2, 3), wp.float64),
        "qf4": wp.quat,
        "tf2": wp.transformh,
        "bf2": wp.bfloat16,
        "u1": wp.uint8,
        "b": bool,
        "a2v3f4": wp.array2d(dtype=wp.vec3),
        "a?i4": wp.array[int, typing.Any],
        "ia1f4": wp.indexedarray(dtype=float),
        "fa1f8": wp.fabricarray[wp.float64],
        "tr?f4": wp.tile[float],
        "tr84f4": wp.tile[float, 8, 4],
    }
    assert {code: get_type_code(kind) for code, kind in known.items()} == {c: c for c in known}
    with pytest.raises(TypeError, match="Unrecognized type"):
        get_type_code(dict)
