"""Launches made by hand, descriptors as arguments, and errors in the words of Warp."""

import ctypes
import typing

import numpy as np
import pytest

import warp as wp


@wp.struct
class Step:
    scale: float
    values: wp.array(dtype=float)


@wp.kernel
def advance(step: Step, shift: wp.vec2, out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = step.scale * step.values[i] + shift[1]


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def count_any(x: wp.array(dtype=typing.Any), y: wp.array(dtype=int)):
    y[0] = x.shape[0]


def test_a_launch_without_arguments_gets_them_later(device):
    command = wp.Launch(advance, device)
    assert command.bounds.size == 0
    step = Step(scale=2.0, values=wp.array([1.0, 2.0, 3.0], dtype=float, device=device))
    out = wp.zeros(3, dtype=float, device=device)
    command.set_param_by_name("step", step)
    command.set_param_at_index(2, out)
    command.launch()
    np.testing.assert_array_equal(out.numpy(), 0.0)
    command.set_dim(3)
    command.launch()
    np.testing.assert_array_equal(out.numpy(), [2.0, 4.0, 6.0])
    command.set_param_by_name("shift", wp.vec2(5.0, 1.0))
    command.launch()
    np.testing.assert_array_equal(out.numpy(), [3.0, 5.0, 7.0])
    with pytest.raises(TypeError, match="generic"):
        wp.Launch(count_any, device)


@wp.kernel
def place(frame: wp.transform, out: wp.array(dtype=float)):
    for j in range(7):
        out[j] = frame[j]


def test_parameters_that_are_not_set_are_zero(device):
    """The default transform is the identity, a parameter that was never set is all zero."""
    out = wp.full(7, -1.0, dtype=float, device=device)
    command = wp.Launch(place, device)
    command.set_param_by_name("out", out)
    command.set_dim(1)
    command.launch()
    np.testing.assert_array_equal(out.numpy(), 0.0)


@wp.kernel
def sum_of_block(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    total = wp.tile_sum(wp.tile(x[i]))
    out[i] = total[0]


def test_a_launch_by_hand_has_the_blocks_it_was_made_with():
    """Blocks of 4 threads stay blocks of 4 threads after `enable_cpu_blocks` is taken back."""
    x = wp.array(np.arange(8.0), dtype=float, device="cpu")
    out = wp.zeros(8, dtype=float, device="cpu")
    wp.config.enable_cpu_blocks = True
    try:
        command = wp.Launch(sum_of_block, "cpu", block_dim=4)
        assert command.block_dim == 4
        assert wp.Launch(advance, "cpu", block_dim=64).block_dim == 64
        with pytest.raises(ValueError, match="at most 1024 threads"):
            wp.Launch(advance, "cpu", block_dim=1025)
    finally:
        wp.config.enable_cpu_blocks = False
    command.set_params([x, out])
    command.set_dim(8)
    command.launch()
    np.testing.assert_array_equal(out.numpy(), [6.0] * 4 + [22.0] * 4)


def test_recorded_launches_see_changes_of_structs(device):
    step = Step(scale=1.0, values=wp.array([1.0, 2.0], dtype=float, device=device))
    out = wp.zeros(2, dtype=float, device=device)
    command = wp.launch(advance, 2, [step, wp.vec2()], [out], device=device, record_cmd=True)
    assert command.block_dim == (1 if device == "cpu" else 256)
    for scale, values in ((1.0, [1.0, 2.0]), (3.0, [1.0, 2.0]), (3.0, [4.0, 5.0])):
        step.scale = scale
        step.values = wp.array(values, dtype=float, device=device)
        command.launch()
        np.testing.assert_array_equal(out.numpy(), scale * np.array(values))


def test_the_adjoint_of_a_launch_without_arguments(device):
    x = wp.array([1.0, 2.0, 3.0], dtype=float, device=device, requires_grad=True)
    y = wp.zeros_like(x)
    y.grad.fill_(1.0)
    command = wp.Launch(square, device, adjoint=True)
    command.set_param_by_name("x", x)
    command.set_param_by_name("y", y)
    command.set_dim(3)
    command.launch()
    np.testing.assert_array_equal(x.grad.numpy(), [2.0, 4.0, 6.0])


def test_descriptors_are_arguments(device):
    x = wp.array([2.0, 3.0], dtype=float, device=device)
    y = wp.zeros(2, dtype=float, device=device)
    wp.launch(square, 2, [x.__ctype__()], [y.__ctype__()], device=device)
    np.testing.assert_array_equal(y.numpy(), [4.0, 9.0])
    flat = wp.zeros((2, 2), dtype=float, device=device).__ctype__()
    with pytest.raises(TypeError, match="of 2 dimensions"):
        wp.launch(square, 2, [flat], [y], device=device)


@pytest.mark.parametrize(
    ("kernel", "arguments", "words"),
    [
        (
            square,
            [[1.0], None],
            r"an array of type array\(ndim=1, dtype=float32\), but passed value",
        ),
        (
            square,
            ["int", None],
            "expects an array with dtype=float32 but passed array has dtype=int32",
        ),
        (square, ["flat", None], r"an array with 1 dimension\(s\) but the passed array has 2"),
        (advance, [None, wp.vec2(), None], "argument 'step' expects Step but got None"),
        (advance, [Step(), 3.0, None], "argument 'shift' expects vec2f but got a single value"),
        (
            advance,
            [Step(), wp.int32(3), None],
            "argument 'shift' expects vec2f but got a single value",
        ),
    ],
)
def test_errors_have_the_words_of_warp(kernel, arguments, words, config):
    config.peer_messages = True
    made = {"int": wp.zeros(2, dtype=int, device="cpu"), "flat": wp.zeros((2, 2), device="cpu")}
    values = [made[v] if isinstance(v, str) else v for v in arguments]
    with pytest.raises(TypeError, match=words):
        wp.launch(kernel, 1, values, device="cpu")


def test_what_cannot_be_converted_is_a_wrong_value(config):
    config.peer_messages = True
    with pytest.raises(ValueError, match="Failed to convert argument for param shift to vec2f"):
        wp.launch(advance, 1, [Step(), None, None], device="cpu")


def test_arrays_as_pointers_and_empty_ones():
    a = wp.array([[1, 2], [3, 4]], dtype=int, device="cpu")
    pointer = a.cptr()
    assert [pointer[i] for i in range(4)] == [1, 2, 3, 4]
    assert ctypes.addressof(pointer.contents) == a.ptr
    with pytest.raises(RuntimeError, match="contiguous"):
        a[:, 0].cptr()
    empty = wp.zeros((1, 0), dtype=wp.vec2f, device="cpu")
    assert np.asarray(empty).shape == (1, 0, 2)
    assert wp.array([1.0, 2.0, 3.0], dtype=float, device="cpu").view(wp.vec3).shape == (1,)


def test_structs_from_memory_know_their_arrays(device):
    values = wp.array([1.0, 2.0], dtype=float, device=device, requires_grad=True)
    step = Step(scale=2.0, values=values)
    (found,) = wp.array([step], dtype=Step, device=device).list()
    assert found.scale == 2.0 and found.values.ptr == values.ptr
    assert (found.values.shape, found.values.dtype) == ((2,), wp.float32)
    np.testing.assert_array_equal(found.values.numpy(), [1.0, 2.0])
    assert wp.array([Step()], dtype=Step, device=device).list()[0].values is None


def test_indexed_arrays_in_structs_are_those_assigned(device):
    @wp.struct
    class Chosen:
        values: wp.indexedarray(dtype=float)

    data = wp.array([1.0, 2.0, 3.0], dtype=float, device=device)
    picked = wp.indexedarray(data, [wp.array([2, 0], dtype=int, device=device)])
    chosen = Chosen()
    chosen.values = picked
    assert chosen.values is picked
    chosen.values = None
    assert chosen.values is None


def test_outputs_of_map_that_do_not_fit(device, config):
    config.peer_messages = True
    x = wp.zeros(3, dtype=float, device=device)
    for out, words in (
        (wp.zeros(2, dtype=float, device=device), r"Output array shape \(2,\) does not match"),
        (wp.zeros(3, dtype=int, device=device), "Output array dtype int32 does not match"),
        ([x, wp.zeros_like(x)], r"Number of provided output arrays \(2\)"),
    ):
        with pytest.raises(TypeError, match=words):
            wp.map(wp.sin, x, out=out)
    with pytest.raises(TypeError, match=r"Number of input arguments \(2\) does not match"):
        wp.map(cube, x, x)


@wp.func
def cube(x: float):
    return x * x * x


def test_functions_and_tiles_at_python_scope():
    function, module = wp.utils.create_warp_function(lambda a, b: a * b + 1.0)
    assert function.key.startswith("func_") and len(function.key) == 21
    assert function(2.0, 3.0) == 7.0 and module is wp.get_module(__name__)
    x = wp.array([2.0, 3.0], dtype=float, device="cpu")
    np.testing.assert_array_equal(wp.map(function, x, x).numpy(), [5.0, 10.0])
    assert wp.types.type_is_tile(wp.tile) and not wp.types.is_tile(wp.tile)
    assert wp.types.is_tile(wp.tile(dtype=float, shape=(2, 2)))
    for tile in (
        wp.tile(dtype=float, shape=4),
        wp.tile(float, [4]),
        wp.tile(wp.float32, (4,), storage="shared"),
    ):
        assert tile.shape == (4,) and tile.dtype is wp.float32
    for wrong in ({"shape": 4, "storage": "heap"}, {"shape": 0}, {}, {"shape": "x"}):
        with pytest.raises(TypeError):
            wp.tile(dtype=float, **wrong)
    assert not wp.types.is_tile(3) and not wp.types.type_is_tile(wp.array)


@pytest.mark.parametrize("scalar", [wp.int8, wp.uint16, wp.int32, wp.uint64])
def test_powers_of_ints_are_refused_as_in_kernels(scalar):
    with pytest.raises(TypeError):
        scalar(2) ** scalar(3)
    assert float(wp.float64(2) ** wp.float64(3)) == 8.0
