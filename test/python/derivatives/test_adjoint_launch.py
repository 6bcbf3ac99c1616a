"""`wp.launch(..., adjoint=True)` and the gradients of arrays."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def square(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = a * x[i] * x[i]


@wp.kernel
def shift(x: wp.array(dtype=float), z: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * z[i + 1]


def ramp(n, device, **options):
    return wp.array(np.arange(n, dtype=np.float32), dtype=float, device=device, **options)


def seeded(n, device):
    y = wp.zeros(n, device=device, requires_grad=True)
    y.grad.fill_(1.0)
    return y


def test_gradients_of_the_arguments(device):
    x, y = ramp(5, device, requires_grad=True), seeded(5, device)
    wp.launch(square, 5, [3.0, x], [y], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [0, 6, 12, 18, 24]
    # Elements that the launch has written are not written again, and their gradients are taken.
    assert not y.numpy().any() and not y.grad.numpy().any()
    y.grad.fill_(1.0)
    wp.launch(square, 5, [3.0, x], [y], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [0, 12, 24, 36, 48]


def test_gradients_of_the_launch(device):
    """Gradients that the launch names are used instead of those of the arguments."""
    x, y = ramp(4, device, requires_grad=True), wp.zeros(4, device=device)
    gx, gy = wp.zeros(4, device=device), wp.ones(4, device=device)
    wp.launch(square, 4, [1.0, x], [y], [None, gx], [gy], device=device, adjoint=True)
    assert gx.numpy().tolist() == [0, 2, 4, 6]
    assert not x.grad.numpy().any() and y.grad is None
    # None stands for the argument's own gradient, and numbers have none.
    gy.fill_(1.0)
    wp.launch(square, 4, [1.0, x, y], [], [7.0, None, gy], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [0, 2, 4, 6]


@pytest.mark.parametrize("has_own", [False, True])
@pytest.mark.parametrize("recorded", [False, True])
def test_named_gradients_of_results_stay(device, has_own, recorded):
    """A gradient that the caller owns, as of another library, may be read again."""
    x, y = ramp(4, device), wp.zeros(4, device=device, requires_grad=has_own)
    if has_own:
        y.grad.fill_(7.0)
    gx, gy = wp.zeros(4, device=device), wp.ones(4, device=device)
    options = {"device": device, "adjoint": True, "record_cmd": recorded}
    for count in (1, 2, 3):
        command = wp.launch(square, 4, [1.0, x], [y], [None, gx], [gy], **options)
        if recorded:
            command.launch()
        assert gx.numpy().tolist() == [0, 2 * count, 4 * count, 6 * count]
        assert gy.numpy().tolist() == [1] * 4
    assert not has_own or y.grad.numpy().tolist() == [7] * 4


@pytest.mark.parametrize("named", [False, True])
@pytest.mark.parametrize("recorded", [False, True])
def test_retained_gradients_stay(device, named, recorded):
    """Results with `retain_grad` keep their gradient, as in NVIDIA Warp 1.19; others lose it."""
    x = ramp(4, device)
    x.requires_grad = True
    kept = wp.zeros(4, device=device, requires_grad=True, retain_grad=True)
    lost = wp.zeros(4, device=device, requires_grad=True)
    options = {"device": device, "adjoint": True, "record_cmd": recorded}
    for y, left in ((kept, 1), (lost, 0), (kept, 1)):
        x.grad.zero_()
        for count in (1, 2, 3):
            y.grad.fill_(1.0)
            given = [y.grad] if named else [None]
            command = wp.launch(square, 4, [1.0, x], [y], [None, None], given, **options)
            if recorded:
                command.launch()
            assert x.grad.numpy().tolist() == [0, 2 * count, 4 * count, 6 * count]
            assert y.grad.numpy().tolist() == [left] * 4


@wp.struct
class Output:
    y: wp.array(dtype=float)


@wp.struct
class NestedOutput:
    inner: Output


@wp.kernel
def square_both(x: wp.array(dtype=float), out: Output, z: wp.array(dtype=float)):
    i = wp.tid()
    out.y[i] = x[i] * x[i]
    z[i] = x[i]


@wp.kernel
def square_inner(x: wp.array(dtype=float), out: NestedOutput, z: wp.array(dtype=float)):
    i = wp.tid()
    out.inner.y[i] = x[i] * x[i]
    z[i] = x[i]


@pytest.mark.parametrize("kernel", [square_both, square_inner])
@pytest.mark.parametrize("retained", [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_retained_gradients_in_structs_stay(device, kernel, retained):
    """Results in structs, and beside them, keep gradients that ask for it, as in NVIDIA Warp."""
    x = ramp(4, device, requires_grad=True)
    y, z = (wp.zeros(4, device=device, requires_grad=True, retain_grad=bool(r)) for r in retained)
    out, nested = Output(), NestedOutput()
    out.y = y
    nested.inner = out
    for count in (1, 2):
        y.grad.fill_(1.0)
        z.grad.fill_(3.0)
        wp.launch(
            kernel, 4, [x, out if kernel is square_both else nested, z], device=device, adjoint=True
        )
        assert x.grad.numpy().tolist() == [count * v for v in (3, 5, 7, 9)]
        assert y.grad.numpy().tolist() == [1.0 * retained[0]] * 4
        assert z.grad.numpy().tolist() == [3.0 * retained[1]] * 4


def test_named_gradients_beside_structs_stay(device):
    """Gradients that the launch names, in a struct and of an array, may be read again."""
    x, z = ramp(4, device, requires_grad=True), wp.zeros(4, device=device)
    out, named = Output(), Output()
    out.y, named.y = wp.zeros(4, device=device), wp.ones(4, device=device)
    given = wp.full(4, 3.0, dtype=float, device=device)
    for count in (1, 2):
        wp.launch(
            square_both, 4, [x, out, z], [], [None, named, given], device=device, adjoint=True
        )
        assert x.grad.numpy().tolist() == [count * v for v in (3, 5, 7, 9)]
        assert named.y.numpy().tolist() == [1] * 4
        assert given.numpy().tolist() == [3] * 4


def test_named_gradients_that_are_added_to(device):
    """Results that the launch also reads get sums in the gradients that it names."""

    @wp.kernel
    def scale(y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = 3.0 * y[i]

    y, gy = ramp(4, device), wp.ones(4, device=device)
    wp.launch(scale, 4, [y], [], [gy], device=device, adjoint=True)
    assert gy.numpy().tolist() == [3] * 4


def test_named_gradients_with_strides_of_their_own(device):
    """Gradients that a launch names may be views with gaps; what is between stays."""
    x, y = ramp(4, device), wp.zeros(4, dtype=float, device=device)
    gx = wp.ones((4, 2), dtype=float, device=device)
    gy = wp.full((4, 3), 2.0, dtype=float, device=device)
    for recorded in (False, True):
        made = wp.launch(
            square,
            4,
            [1.0, x],
            [y],
            [None, gx[:, 1]],
            [gy[:, 2]],
            device=device,
            adjoint=True,
            record_cmd=recorded,
        )
        if recorded:
            made.launch()
        expected = 1.0 + (1 + recorded) * np.array([0.0, 4.0, 8.0, 12.0])
        assert np.array_equal(gx.numpy()[:, 1], expected)
        assert (gx.numpy()[:, 0] == 1.0).all() and (gy.numpy() == 2.0).all()


def test_no_gradient_asked_for(device):
    x, y = ramp(4, device), seeded(4, device)
    wp.launch(square, 4, [1.0, x], [y], device=device, adjoint=True)
    assert not y.grad.numpy().any()
    wp.launch(square, 4, [1.0, x], [wp.zeros(4, device=device)], device=device, adjoint=True)
    wp.launch(square, 0, [1.0, x], [y], device=device, adjoint=True)


def test_too_many_gradients(device):
    x, y = ramp(4, device), seeded(4, device)
    with pytest.raises(ValueError, match=r"at most 2 'adj_inputs', but got 3"):
        wp.launch(square, 4, [1.0, x], [y], [None] * 3, device=device, adjoint=True)
    with pytest.raises(ValueError, match=r"at most 3 gradients, but got 4"):
        wp.launch(square, 4, [1.0, x], [y], [], [None] * 2, device=device, adjoint=True)
    with pytest.raises(TypeError, match=r"launch\('square'\): expects 3 arguments, but got 2"):
        wp.launch(square, 4, [1.0, x], device=device, adjoint=True)


def test_backward_disabled(device):
    @wp.kernel(enable_backward=False)
    def copy(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = x[i]

    x, y = ramp(4, device, requires_grad=True), seeded(4, device)
    with pytest.raises(RuntimeError, match=r"_copy'.*`enable_backward=False`, remove that option"):
        wp.launch(copy, 4, [x], [y], device=device, adjoint=True)


def test_layout_of_gradients(device):
    """A gradient has the strides of its array, so kernels need only one set of them."""
    base = wp.array(np.arange(24.0).reshape(4, 6), dtype=float, device=device)
    for view in (base[:, ::2], base.transpose(), base[1], base[:, 3]):
        view.requires_grad = True
        assert view.grad.shape == view.shape and view.grad.strides == view.strides
        assert not view.grad.numpy().any()
    assert base.grad is None
    x, y = base[:, 3], seeded(4, device)
    x.requires_grad = True
    wp.launch(square, 4, [1.0, x], [y], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [6, 18, 30, 42]


def test_views_of_gradients(device):
    x, y = wp.ones((3, 4), device=device, requires_grad=True), seeded(3, device)
    wp.launch(square, 3, [1.0, x[:, 1]], [y], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [[0, 2, 0, 0]] * 3


def test_repeated_elements(device):
    """Threads with different indices meet where an array has stride 0."""
    base = wp.full(1, 3.0, device=device)
    x = wp.array(ptr=base.ptr, shape=1000, strides=(0,), dtype=float, device=device)
    x.grad = wp.array(
        ptr=(g := wp.zeros(1, device=device)).ptr,
        shape=1000,
        strides=(0,),
        dtype=float,
        device=device,
    )
    wp.launch(square, 1000, [1.0, x], [seeded(1000, device)], device=device, adjoint=True)
    assert g.numpy()[0] == 6000


def test_one_array_twice(device):
    """Reading one array through two arguments is fine; the gradients add up."""
    x, y = ramp(1001, device, requires_grad=True), seeded(1000, device)
    wp.launch(shift, 1000, [x, x], [y], device=device, adjoint=True)
    i = np.arange(1001)
    expected = np.where(i < 1000, i + 1, 0) + np.where(i > 0, i - 1, 0)
    assert (x.grad.numpy() == expected).all()


def test_written_overlap(device):
    x = ramp(9, device, requires_grad=True)
    with pytest.raises(
        RuntimeError, match=r"arguments 'y', which is written, and 'x' overlap.*to another array"
    ):
        wp.launch(square, 8, [1.0, x[:8]], [x[1:]], device=device, adjoint=True)
    # Every other element is another array.
    x.grad.fill_(1.0)
    wp.launch(square, 4, [1.0, x[0:8:2]], [x[1:9:2]], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [1, 0, 5, 0, 9, 0, 13, 0, 1]


def test_gradients_that_do_not_fit():
    x = wp.zeros((3, 2), device="cpu")
    with pytest.raises(ValueError, match=r"of shape \(3, 2\), but got shape \(2, 3\)"):
        x.grad = wp.zeros((2, 3), device="cpu")
    with pytest.raises(ValueError, match=r"'float32' for an array of 'float32', but got 'float64'"):
        x.grad = wp.zeros((3, 2), dtype=wp.float64, device="cpu")
    with pytest.raises(ValueError, match=r"strides \(8, 4\).*got \(4, 12\).*`requires_grad"):
        x.grad = wp.zeros((2, 3), device="cpu").transpose()
    with pytest.raises(ValueError, match="expects an array as the gradient.*but got 'float'"):
        x.grad = 1.0
    with pytest.raises(ValueError, match="gradient of 'float16' or 'float32' for an array"):
        wp.zeros(3, dtype=wp.float16, device="cpu").grad = wp.zeros(3, wp.float64, "cpu")


@wp.struct
class Inner:
    values: wp.array(dtype=float)


@wp.struct
class Outer:
    scale: float
    inner: Inner
    out: wp.array(dtype=float)


@wp.kernel
def through_struct(s: Outer):
    i = wp.tid()
    s.out[i] = s.scale * s.inner.values[i] * s.inner.values[i]


def make_struct(n, device):
    s = Outer()
    s.scale = 2.0
    s.inner.values = ramp(n, device)
    s.out = wp.zeros(n, device=device)
    return s


def test_struct_fields(device):
    """Gradients that arrays got after they were put into the struct count."""
    s = make_struct(4, device)
    s.inner.values.requires_grad = True
    s.out.requires_grad = True
    s.out.grad.fill_(1.0)
    wp.launch(through_struct, 4, [s], device=device, adjoint=True)
    assert s.inner.values.grad.numpy().tolist() == [0, 4, 8, 12]
    assert not s.out.grad.numpy().any()


def test_struct_of_gradients(device):
    s, g = make_struct(4, device), make_struct(4, device)
    g.inner.values.zero_()
    g.out.fill_(1.0)
    wp.launch(through_struct, 4, [s], [], [g], device=device, adjoint=True)
    assert g.inner.values.numpy().tolist() == [0, 4, 8, 12]
    assert s.inner.values.grad is None


def test_recorded_launch(device):
    x, y = ramp(4, device, requires_grad=True), seeded(4, device)
    command = wp.launch(square, 4, [1.0, x], [y], device=device, adjoint=True, record_cmd=True)
    assert not x.grad.numpy().any() and command.kernel is square
    command.launch()
    assert x.grad.numpy().tolist() == [0, 2, 4, 6]
    gx, gy = wp.zeros(4, device=device), wp.ones(4, device=device)
    command.set_param_by_name("a", 3.0)
    command.set_param_by_name("x", gx, adjoint=True)
    command.set_param_at_index(2, gy, adjoint=True)
    command.set_dim(2)
    command.launch()
    assert gx.numpy().tolist() == [0, 6, 0, 0] and gy.numpy().tolist() == [1] * 4
    plain = wp.launch(square, 4, [1.0, x], [y], device=device, record_cmd=True)
    with pytest.raises(RuntimeError, match="has no gradients, record it with `adjoint=True`"):
        plain.set_param_by_name("x", gx, adjoint=True)


def test_singular_points(device, capfd):
    @wp.kernel
    def root(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = wp.sqrt(x[i])

    def gradient(policy):
        x, y = wp.array([0.0, 4.0, 0.0], dtype=float, device=device), seeded(3, device)
        x.requires_grad = True
        wp.config.singular = policy
        try:
            wp.launch(root, 3, [x], [y], device=device, adjoint=True)
        finally:
            wp.config.singular = "pinned"
        return x.grad.numpy().tolist()

    assert gradient("pinned") == [0, 0.25, 0]
    assert gradient("strict") == [np.inf, 0.25, np.inf]
    assert not capfd.readouterr().out
    assert gradient("report") == [0, 0.25, 0]
    lines = capfd.readouterr().out.strip().splitlines()
    assert len(lines) == 1 and "test_adjoint_launch.py:" in lines[0] and " 2 times" in lines[0]
    with pytest.raises(ValueError, match="config.singular expects one of 'pinned', 'strict'"):
        wp.config.singular = "zero"


def test_notice_where_gradients_stop(device, capfd):
    @wp.kernel
    def truncate(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = float(int(x[i])) * x[i]

    x, y = wp.full(3, 2.5, device=device, requires_grad=True), seeded(3, device)
    for _ in range(2):
        y.grad.fill_(1.0)
        wp.launch(truncate, 3, [x], [y], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [4, 4, 4]
    lines = [line for line in capfd.readouterr().out.splitlines() if "gradient stops" in line]
    assert len(lines) == 1 and "test_adjoint_launch.py:" in lines[0]


def test_one_thread_only(device):
    @wp.kernel
    def running_product(x: wp.array(dtype=float), p: wp.array(dtype=float)):
        for k in range(x.shape[0]):
            p[k + 1] = x[k] * p[k]

    x = wp.array([2.0, 3.0, 4.0], dtype=float, device=device, requires_grad=True)
    p = wp.array([1.0, 2.0, 6.0, 24.0], dtype=float, device=device, requires_grad=True)
    p.grad.assign([0.0, 0.0, 0.0, 1.0])
    with pytest.raises(RuntimeError, match="right for one thread only, but the launch has 2"):
        wp.launch(running_product, 2, [x, p], device=device, adjoint=True)
    wp.launch(running_product, 1, [x, p], device=device, adjoint=True)
    assert x.grad.numpy().tolist() == [12, 8, 6]


def test_primal_is_not_changed():
    """Asking for a derivative leaves the primal's code as it is."""

    @wp.kernel
    def twice(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = 2.0 * x[i]

    before = [twice.ir(stage) for stage in ("warp", "thread", "llvm")]
    times = twice.prepare().compile_times()
    x, y = ramp(3, "cpu", requires_grad=True), seeded(3, "cpu")
    wp.launch(twice, 3, [x], [y], device="cpu", adjoint=True)
    assert [twice.ir(stage) for stage in ("warp", "thread", "llvm")] == before
    assert twice.prepare().compile_times() == times


def test_derivative_as_text():
    assert "warp.grad" in square.ir("adjoint")
    assert "_tangent" in square.ir("tangent")
    with pytest.raises(ValueError, match="'adjoint', 'tangent'"):
        square.ir("gradient")


def scattered(n, buckets, device):
    """Sums whose last bits depend on the order of the terms."""
    random = np.random.default_rng(3)
    x = random.standard_normal(n).astype(np.float32) * 10.0 ** random.integers(-4, 5, n)
    to = random.integers(0, buckets, n)
    return (
        wp.array(x, dtype=float, device=device),
        wp.array(to, dtype=int, device=device),
    )


def test_deterministic_sums(device):
    """Sums of a launch, and sums of gradients, have the same bits in every run."""

    @wp.kernel(module_options={"deterministic": True})
    def histogram(x: wp.array(dtype=float), to: wp.array(dtype=int), sums: wp.array(dtype=float)):
        i = wp.tid()
        wp.atomic_add(sums, to[i], x[i])

    @wp.kernel(module_options={"deterministic": True})
    def gather(
        x: wp.array(dtype=float),
        to: wp.array(dtype=int),
        table: wp.array(dtype=float),
        y: wp.array(dtype=float),
    ):
        i = wp.tid()
        y[i] = table[to[i]] * x[i]

    @wp.kernel(module_options={"deterministic": True})
    def total(x: wp.array(dtype=float), to: wp.array(dtype=int), sums: wp.array(dtype=float)):
        i = wp.tid()
        wp.atomic_add(sums, 0, x[i])

    n = 100_000
    x, to = scattered(n, 7, device)
    found = []
    for _ in range(5):
        sums, one = wp.zeros(7, device=device), wp.zeros(1, device=device)
        wp.launch(histogram, n, [x, to, sums], device=device)
        wp.launch(total, n, [x, to, one], device=device)
        table, y = wp.ones(7, device=device, requires_grad=True), seeded(n, device)
        wp.launch(gather, n, [x, to, table, y], device=device, adjoint=True)
        found.append(b"".join(a.numpy().tobytes() for a in (sums, one, table.grad)))
    assert len(set(found)) == 1
    exact = np.bincount(to.numpy(), x.numpy().astype(np.float64), 7)
    scale = np.bincount(to.numpy(), np.abs(x.numpy()).astype(np.float64), 7)
    assert (np.abs(table.grad.numpy() - exact) < 1e-4 * scale).all()


def test_deterministic_setting():
    assert wp.config.deterministic == wp.DeterministicMode.NOT_GUARANTEED
    module = wp.get_module(__name__)
    assert not square.is_deterministic
    for mode in (wp.DeterministicMode.RUN_TO_RUN, wp.config.DeterministicMode.GPU_TO_GPU):
        wp.set_module_options({"deterministic": mode}, module)
        assert square.is_deterministic
    wp.set_module_options({"deterministic": wp.DeterministicMode.NOT_GUARANTEED}, module)
    assert not square.is_deterministic
    wp.set_module_options({"deterministic": "run_to_run"}, module)
    try:
        assert square.is_deterministic
    finally:
        wp.set_module_options({"deterministic": "not_guaranteed"}, module)
    assert not square.is_deterministic
