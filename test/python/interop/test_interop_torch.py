"""PyTorch: tensors and arrays over the same memory, with their gradients and streams."""

import gc
import subprocess
import sys
import weakref

import numpy as np
import pytest

import warp as wp

torch = pytest.importorskip("torch")

SCALARS = [wp.bool, *wp.types.SCALAR_TYPES]


@pytest.fixture(autouse=True)
def has_device(request):
    device = request.getfixturevalue("device") if "device" in request.fixturenames else "cpu"
    if device != "cpu" and not torch.cuda.is_available():
        pytest.skip("PyTorch without CUDA")


@wp.kernel
def scale(x: wp.array(dtype=float), s: float):
    i = wp.tid()
    x[i] = x[i] * s


@wp.kernel
def shift(x: wp.array2d(dtype=wp.vec3), by: wp.vec3):
    i, j = wp.tid()
    x[i, j] = x[i, j] + by


def test_import_leaves_pytorch_alone():
    code = "import sys, warp; warp.zeros(3); sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_dtypes_and_devices(device):
    for scalar in SCALARS:
        assert wp.dtype_from_torch(wp.dtype_to_torch(scalar)) is scalar
    assert wp.dtype_to_torch(float) is torch.float32
    for dtype in (torch.complex64, wp.vec3):
        with pytest.raises(TypeError):
            (wp.dtype_to_torch if dtype is wp.vec3 else wp.dtype_from_torch)(dtype)
    assert wp.device_to_torch(device) == device
    assert wp.device_from_torch(torch.device(device)) is wp.get_device(device)
    assert wp.device_from_torch(device) is wp.get_device(device)
    with pytest.raises(ValueError, match="meta"):
        wp.device_from_torch("meta")


@pytest.mark.parametrize("scalar", SCALARS, ids=lambda t: t.__name__)
def test_scalars_share_memory(device, scalar):
    t = torch.ones(5, dtype=wp.dtype_to_torch(scalar), device=device)
    a = wp.from_torch(t)
    assert (a.dtype, a.shape, a.ptr, str(a.device)) == (scalar, (5,), t.data_ptr(), device)
    back = wp.to_torch(a)
    assert (back.dtype, back.data_ptr(), back.device) == (t.dtype, t.data_ptr(), t.device)
    a.zero_()
    assert not back.to(torch.float64).any()


# Kernels see what PyTorch wrote, and the reverse, without anybody waiting in between.
def test_kernels_and_operations_in_turn(device):
    t = torch.ones(100_000, device=device)
    a = wp.from_torch(t)
    for _ in range(5):
        wp.launch(scale, dim=a.size, inputs=[a, 3.0], device=device)
        t = wp.to_torch(a)
        t += 1.0
    assert torch.equal(t.cpu(), torch.full((100_000,), 364.0))


def test_composites(device):
    t = torch.zeros(4, 2, 3, device=device)
    a = wp.from_torch(t, dtype=wp.vec3)
    assert (a.shape, a.dtype) == ((4, 2), wp.vec3)
    wp.launch(shift, dim=(4, 2), inputs=[a, wp.vec3(1.0, 2.0, 3.0)], device=device)
    assert torch.equal(wp.to_torch(a).cpu(), torch.tensor([1.0, 2.0, 3.0]).expand(4, 2, 3))
    assert wp.to_torch(wp.zeros(6, dtype=wp.mat44d, device=device)).shape == (6, 4, 4)
    assert wp.from_torch(torch.zeros(7, device=device), dtype=wp.transform).shape == (1,)
    assert wp.from_torch(torch.tensor(2.0, device=device)).list() == [2.0]


def test_strides(device):
    t = torch.arange(48.0, device=device).reshape(4, 4, 3)
    for view in (t[::2, 1:], t.transpose(0, 1)):
        a = wp.from_torch(view, dtype=wp.vec3)
        wp.launch(shift, dim=a.shape, inputs=[a, wp.vec3(0.5)], device=device)
        assert np.array_equal(a.numpy(), view.cpu().numpy())
    transposed = wp.zeros((3, 5), dtype=float, device=device).transpose()
    assert wp.to_torch(transposed).stride() == (1, 5)
    # An expanded dimension has stride 0.
    assert wp.from_torch(torch.ones(1, device=device).expand(3)).list() == [1.0] * 3


def test_signs_of_integers(device):
    t = torch.full((3,), -1, dtype=torch.int32, device=device)
    assert wp.from_torch(t, dtype=wp.uint32).list() == [2**32 - 1] * 3


def test_each_side_keeps_memory_alive(device):
    t = torch.full((4,), 2.0, device=device)
    a = wp.from_torch(t)
    del t
    gc.collect()
    assert a.list() == [2.0] * 4
    gone = weakref.ref(a)
    t = wp.to_torch(a)
    del a
    gc.collect()
    assert gone() is not None
    assert t.sum() == 8.0
    del t
    gc.collect()
    assert gone() is None


# The gradient is one memory, too.
def test_gradient_of_tensor(device):
    t = torch.ones(3, 3, device=device, requires_grad=True)
    a = wp.from_torch(t, dtype=wp.vec3)
    assert a.requires_grad
    assert a.grad.ptr == t.grad.data_ptr() == a.grad_ptr
    a.grad.fill_(5.0)
    assert torch.equal(t.grad.cpu(), torch.full((3, 3), 5.0))
    assert wp.from_torch(t).grad.ptr == a.grad.ptr
    assert wp.from_torch(t, requires_grad=False).grad is None
    assert t.requires_grad


def test_gradient_given(device):
    t = torch.ones(4, device=device)
    g = torch.zeros(4, device=device)
    assert wp.from_torch(t, grad=g).grad.ptr == g.data_ptr()
    a = wp.zeros(4, device=device)
    assert wp.from_torch(t, grad=a).grad is a
    with pytest.raises(ValueError, match="strides"):
        wp.from_torch(t, grad=torch.zeros(8, device=device)[::2])


def test_gradient_has_strides_of_tensor(device):
    t = torch.ones(3, 4, device=device).T.requires_grad_()
    a = wp.from_torch(t)
    assert a.strides == a.grad.strides


def test_gradient_of_array(device):
    a = wp.ones(3, dtype=wp.vec2, device=device, requires_grad=True)
    t = wp.to_torch(a)
    assert t.requires_grad and t.grad.data_ptr() == a.grad.ptr
    t.grad.fill_(2.0)
    assert a.grad.list() == [wp.vec2(2.0)] * 3
    assert not wp.to_torch(a, requires_grad=False).requires_grad


def test_gradient_of_narrow_tensor(device):
    """Gradients of 16 bits are the tensor's own, unless they are to have 32."""
    t = torch.ones(4, dtype=torch.bfloat16, device=device, requires_grad=True)
    a = wp.from_torch(t)
    assert a.grad.dtype is wp.bfloat16 and t.grad.data_ptr() == a.grad.ptr
    given = torch.zeros_like(t)
    assert wp.from_torch(t, grad=given).grad.ptr == given.data_ptr()
    y = wp.zeros(4, dtype=wp.bfloat16, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(narrow_square, 4, [a, y], device=device)
    tape.backward(grads={y: wp.full(4, 3.0, dtype=wp.bfloat16, device=device)})
    wp.synchronize()
    assert t.grad.tolist() == [6.0] * 4
    b = wp.ones(3, dtype=wp.float16, device=device, requires_grad=True)
    made = wp.to_torch(b)
    assert made.requires_grad and made.grad.data_ptr() == b.grad.ptr
    wide = wp.ones(3, dtype=wp.float16, device=device, requires_grad=True, grad_dtype=wp.float32)
    assert wp.to_torch(wide).requires_grad and wp.to_torch(wide).grad is None


@wp.kernel
def narrow_square(x: wp.array(dtype=wp.bfloat16), y: wp.array(dtype=wp.bfloat16)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def weighted_square(x: wp.array(dtype=float), w: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = w[i % w.shape[0]] * x[i] * x[i]


class WeightedSquare(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x, w):
        y = torch.empty_like(x)
        ctx.save_for_backward(x, w, y)
        arrays = [wp.from_torch(t.detach()) for t in (x, w, y)]
        wp.launch(weighted_square, len(x), arrays, device=str(x.device))
        return y

    @staticmethod
    def backward(ctx, gradient):
        tensors = ctx.saved_tensors
        found = [torch.zeros_like(t) for t in tensors[:2]]
        wp.launch(
            weighted_square,
            len(tensors[0]),
            [wp.from_torch(t.detach()) for t in tensors],
            adj_inputs=[wp.from_torch(t) for t in (*found, gradient.clone().contiguous())],
            adjoint=True,
            device=str(gradient.device),
        )
        return tuple(found)


def test_kernel_as_autograd_function(device):
    torch.manual_seed(1)
    x = torch.randn(1000, device=device, requires_grad=True)
    w = torch.randn(7, device=device, requires_grad=True)
    (WeightedSquare.apply(torch.sin(x), w).sum() * 2.0).backward()
    found = x.grad.clone(), w.grad.clone()
    x.grad = w.grad = None
    repeated = w[torch.arange(1000, device=device) % 7]
    ((repeated * torch.sin(x) ** 2).sum() * 2.0).backward()
    assert torch.allclose(found[0], x.grad, rtol=1e-5, atol=1e-6)
    assert torch.allclose(found[1], w.grad, rtol=1e-5, atol=1e-4)


def test_tape_over_tensors(device):
    """A tape writes to the gradients that tensors hold."""
    x = torch.arange(5.0, device=device).requires_grad_()
    w, y = torch.full((2,), 3.0, device=device), torch.zeros(5, device=device).requires_grad_()
    arrays = [wp.from_torch(t) for t in (x, w, y)]
    with wp.Tape() as tape:
        wp.launch(weighted_square, 5, arrays, device=device)
    tape.backward(grads={arrays[2]: wp.ones(5, device=device)})
    wp.synchronize()
    assert x.grad.tolist() == [0, 6, 12, 18, 24]


def test_inner_results_have_a_gradient_of_their_own(device):
    t = torch.ones(3, device=device, requires_grad=True) * 2.0
    assert wp.from_torch(t).grad.list() == [0.0] * 3


def traced(t):
    """A tensor without memory, as PyTorch has them while it traces a program."""
    return pytest.importorskip("torch._subclasses").FakeTensorMode().from_tensor(t)


@pytest.mark.parametrize(
    "make, options, message",
    [
        (lambda: torch.zeros(3).to_sparse(), {}, "strided tensor"),
        (lambda: torch.zeros(3, dtype=torch.complex64), {}, "no scalar type"),
        (lambda: torch.zeros(3, dtype=torch.complex64).conj().imag, {}, "resolve_neg"),
        (lambda: torch.zeros(3), {"dtype": wp.float64}, "'float64'.*'float32'"),
        (lambda: torch.zeros(3, 2), {"dtype": wp.vec3}, "inner dimensions"),
        (lambda: torch.zeros(3, 2).T, {"dtype": wp.vec3}, "packed inner"),
        (lambda: torch.zeros(3, device="meta"), {}, "no device 'meta'"),
        (lambda: [1.0], {}, "expects a tensor"),
        (lambda: torch.zeros(3), {"grad": [1.0]}, "expects a tensor, but got 'list'"),
        (lambda: traced(torch.zeros(3)), {}, "expects a tensor in memory"),
    ],
)
def test_refusals(make, options, message):
    with pytest.raises((TypeError, ValueError), match=message):
        wp.from_torch(make(), **options)


def test_arguments_of_launches(device):
    t = torch.ones(10, device=device)
    wp.launch(scale, dim=10, inputs=[t, 2.0], device=device)
    assert t.sum() == 20.0


def test_read_only_arrays_are_told_of(device):
    """PyTorch cannot be kept from writing to memory that another library calls read-only."""
    x = np.arange(3.0)
    x.flags.writeable = False
    with pytest.warns(UserWarning, match=r"read-only.*wp\.clone"):
        t = wp.to_torch(wp.from_dlpack(x))
    assert t.tolist() == [0.0, 1.0, 2.0]


def test_pinned():
    if not torch.cuda.is_available():
        pytest.skip("PyTorch without CUDA")
    assert wp.from_torch(torch.zeros(3).pin_memory()).pinned


@pytest.mark.cuda
def test_streams():
    side = torch.cuda.Stream()
    with torch.cuda.stream(side):
        ours = wp.stream_from_torch()
    assert ours.cuda_stream == side.cuda_stream
    assert wp.stream_from_torch(side).cuda_stream == side.cuda_stream
    assert wp.stream_to_torch(ours).cuda_stream == side.cuda_stream
    assert wp.stream_to_torch(wp.stream_from_torch("cuda:0")) == torch.cuda.default_stream(0)
    assert wp.stream_to_torch().cuda_stream == wp.get_stream().cuda_stream
    t = torch.zeros(1 << 22, device="cuda")
    torch.cuda.synchronize()
    with torch.cuda.stream(side), wp.ScopedStream(wp.stream_from_torch(side)):
        a = wp.from_torch(t)
        for _ in range(20):
            t += 1.0
            wp.launch(scale, dim=t.numel(), inputs=[a, 2.0])
        assert torch.equal(t, torch.full_like(t, 2.0**21 - 2))


# A tensor made on a side stream is ordered by DLPack.
@pytest.mark.cuda
def test_side_stream_through_dlpack():
    side = torch.cuda.Stream()
    with torch.cuda.stream(side):
        t = torch.zeros(1 << 24, device="cuda")
        for _ in range(50):
            t += 1.0
        a = wp.from_dlpack(t)
    wp.launch(scale, dim=a.size, inputs=[a, 2.0], device="cuda:0")
    assert (a.numpy() == 100.0).all()
