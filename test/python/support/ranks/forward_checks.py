"""Checks of forward mode over ranks: against values, differences and reverse mode."""

import itertools

import checking
import numpy as np

import warp as wp
import warp.distributed as wd


@wp.kernel
def burgers(
    x: wp.array(dtype=wp.float64), k: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)
):
    i = wp.tid() + 1
    y[i] = (
        x[i]
        + k[0] * (x[i + 1] - wp.float64(2.0) * x[i] + x[i - 1])
        - k[1] * x[i] * (x[i + 1] - x[i - 1])
    )


def split(rng, n, grad=True):
    return wp.array(rng.random(n), dtype=wp.float64, requires_grad=grad)


def linear_operations(comm):
    """The tangent of a linear operation is the operation; <A v, y> = <v, A' y> by reverse mode."""
    rng, common = np.random.default_rng(comm.rank), np.random.default_rng(99)
    n, counts = 6, [(comm.rank + r) % 3 for r in range(comm.size)]
    blocks = wd.Blocks((5 * comm.size, 4), 1, True, ranks=(comm.size, 1), comm=comm)
    rows = np.r_[np.arange(9), np.arange(8)]
    graph = wd.Graph(rows, np.r_[np.arange(9), np.arange(1, 9)], by="rows", comm=comm)

    def changed(operation):
        def run(x):
            y = wp.clone(x)
            operation(y)
            return y

        return run

    def overlapped(y):
        with blocks.overlap(y):
            pass

    cases = {
        "all_reduce": (lambda x: wd.all_reduce(wp.clone(x)), n, "to"),
        "exact": (lambda x: wd.all_reduce(wp.clone(x), exact=True), n, "to"),
        "replicate": (wd.replicate, n, "from"),
        "broadcast": (lambda x: wd.broadcast(wp.clone(x)), n, "to"),
        "all_gather": (wd.all_gather, comm.rank + 1, "to"),
        "reduce_scatter": (wd.reduce_scatter, n, ""),
        "all_to_all": (lambda x: wd.all_to_all(x, counts)[0], sum(counts), ""),
        "sum": (lambda x: wd.sum(x, exact=True), comm.rank + 3, "to"),
        "plain sum": (wd.sum, comm.rank, "to"),
        "halo": (changed(blocks.halo), blocks.local, ""),
        "overlap": (changed(overlapped), blocks.local, ""),
        "push": (changed(blocks.push), blocks.local, ""),
        "graph halo": (changed(graph.halo), graph.local, ""),
        "graph overlap": (changed(lambda y: graph.overlap(y).finish()), graph.local, ""),
        "graph push": (changed(graph.push), graph.local, ""),
    }
    for name, (operation, size, replicated) in cases.items():
        source = common if replicated == "from" else rng
        x, v = split(source, size), split(source, size, False)
        tangent = wp.autograd.jvp(operation, [x], [v]).numpy()
        assert np.array_equal(tangent, operation(v).numpy()), name
        y = split(common if replicated == "to" else rng, tangent.shape, False)
        with wp.Tape() as tape:
            z = operation(x)
        tape.backward(grads={z: y})
        left = comm.gather_objects(float((tangent * y.numpy()).sum()))
        right = comm.gather_objects(float((v.numpy() * x.grad.numpy()).sum()))
        left = left[0] if replicated == "to" else sum(left)
        right = right[0] if replicated == "from" else sum(right)
        assert np.isclose(left, right, rtol=1e-12), (name, left, right)


def extrema_and_products(comm):
    """The tangent of an extremum is the holder's; that of an inner product has two terms."""
    values = np.array([[1.0, 5.0, 2.0], [3.0, 5.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    tangents = 1.0 + np.arange(12.0).reshape(4, 3)
    x = wp.array(values[comm.rank], dtype=float)
    v = wp.array(tangents[comm.rank], dtype=float)
    found = wp.autograd.jvp(lambda x: wd.all_reduce(wp.clone(x), "max"), [x], [v])
    holders = values[: comm.size].argmax(axis=0)
    assert np.array_equal(found.numpy(), tangents[holders, np.arange(3)]), found
    rng = np.random.default_rng(comm.rank)
    x, y, v, w = (split(rng, 5) for _ in range(4))
    for exact in (False, True):
        found = wp.autograd.jvp(lambda x, y, e=exact: wd.dot(x, y, exact=e), [x, y], [v, w])
        own = (x.numpy() * w.numpy() + v.numpy() * y.numpy()).sum()
        assert np.isclose(found.numpy()[0], sum(comm.gather_objects(float(own))), rtol=1e-12)


class Program:
    """A nonlinear stencil with replicated coefficients, ending in an inner product."""

    def __init__(self, comm, cells=24):
        self.comm, self.cells = comm, cells
        self.blocks = wd.Blocks((cells,), 1, True, comm=comm)
        self.start = np.random.default_rng(1).random(cells)
        self.theta = np.array([0.1, 0.2])

    def field(self, whole, grad=False):
        x = self.blocks.zeros(wp.float64, requires_grad=grad)
        self.blocks.scatter(whole if self.comm.rank == 0 else None, x)
        return x

    def loss(self, x, theta):
        """The loss of a split state and replicated coefficients."""
        blocks = self.blocks
        k = wd.replicate(theta, self.comm)
        states = [x, *(blocks.zeros(wp.float64, requires_grad=x.requires_grad) for _ in range(4))]
        for number, (a, b) in enumerate(itertools.pairwise(states)):
            if number == 0:
                # The function must not write its argument.
                copied = wp.clone(a)
                a = copied
            blocks.halo(a)
            wp.launch(burgers, blocks.owned, [a, k, b])
        last = blocks.inner(states[-1])
        return wd.dot(last, last, exact=True, comm=self.comm)

    def reference(self, x, theta):
        for _ in range(4):
            right, left = np.roll(x, -1), np.roll(x, 1)
            x = x + theta[0] * (right - 2 * x + left) - theta[1] * x * (right - left)
        return (x * x).sum()

    def theta_array(self, values, grad=False):
        return wp.array(values, dtype=wp.float64, requires_grad=grad)


def derivatives_along_directions(comm):
    """A nonlinear program over ranks along one and several directions, against differences."""
    program, rng = Program(comm), np.random.default_rng(5)
    x, theta = program.field(program.start), program.theta_array(program.theta)
    directions = [(rng.random(program.cells), rng.random(2)) for _ in range(3)]

    def wanted(v, w, h=1e-6):
        ends = [
            program.reference(program.start + s * h * v, program.theta + s * h * w) for s in (1, -1)
        ]
        return (ends[0] - ends[1]) / (2 * h)

    expected = [wanted(*one) for one in directions]
    fields = [program.field(v) for v, _ in directions]
    for k, (_, w) in enumerate(directions):
        found = wp.autograd.jvp(program.loss, [x, theta], [fields[k], program.theta_array(w)])
        assert np.isclose(found.numpy()[0], expected[k], rtol=1e-7), (k, found, expected)
    stacked = wp.array(np.stack([one.numpy() for one in fields]), dtype=wp.float64)
    weights = program.theta_array(np.stack([w for _, w in directions]))
    found = wp.autograd.jvp(program.loss, [x, theta], [stacked, weights])
    assert np.allclose(found.numpy()[:, 0], expected, rtol=1e-7), (found, expected)
    # The same from a gradient.
    x, theta = program.field(program.start, True), program.theta_array(program.theta, True)
    with wp.Tape() as tape:
        loss = program.loss(x, theta)
    tape.backward(loss)
    v, w = directions[0]
    inner = program.blocks.inner
    own = float((inner(x.grad).numpy() * inner(fields[0]).numpy()).sum())
    total = sum(comm.gather_objects(own)) + float(theta.grad.numpy() @ w)
    assert np.isclose(total, expected[0], rtol=1e-7), (total, expected[0])


def second_derivatives(comm):
    """Hessian times vector over ranks: differences of gradients, and it is symmetric."""
    program, rng = Program(comm), np.random.default_rng(6)
    x, theta = program.field(program.start, True), program.theta_array(program.theta, True)
    pairs = [(rng.random(program.cells), rng.random(2)) for _ in range(2)]
    inner = program.blocks.inner

    def gradient(start, coefficients):
        z, t = program.field(start, True), program.theta_array(coefficients, True)
        with wp.Tape() as tape:
            loss = program.loss(z, t)
        tape.backward(loss)
        return inner(z.grad).numpy().copy(), t.grad.numpy().copy()

    products = []
    for v, w in pairs:
        vectors = [program.field(v), program.theta_array(w)]
        by_state, by_theta = wp.autograd.hvp(program.loss, [x, theta], vectors)
        by_state, by_theta = inner(by_state).numpy().copy(), by_theta.numpy().copy()
        h = 1e-5
        ends = [gradient(program.start + s * h * v, program.theta + s * h * w) for s in (1, -1)]
        for found, plus, minus in zip((by_state, by_theta), *ends, strict=True):
            assert np.allclose(found, (plus - minus) / (2 * h), rtol=1e-6, atol=1e-7), found
        products.append((by_state, by_theta))
    forms = []
    for (v, w), (by_state, by_theta) in zip(pairs, products[::-1], strict=True):
        own = float(inner(program.field(v)).numpy() @ by_state)
        forms.append(sum(comm.gather_objects(own)) + float(w @ by_theta))
    assert np.isclose(*forms, rtol=1e-10), forms


def tangents_on_tapes(comm):
    """The gradient of a derivative along a direction is the Hessian times that direction."""
    program, rng = Program(comm), np.random.default_rng(7)
    x, theta = program.field(program.start, True), program.theta_array(program.theta, True)
    v, w = program.field(rng.random(program.cells)), program.theta_array(rng.random(2))
    inner = program.blocks.inner
    by_state, by_theta = wp.autograd.hvp(program.loss, [x, theta], [v, w])
    wanted = inner(by_state).numpy().copy(), by_theta.numpy().copy()
    with wp.Tape() as tape:
        slope = wp.autograd.jvp(program.loss, [x, theta], [v, w])
    tape.backward(grads={slope: wp.ones_like(slope)})
    assert np.allclose(inner(x.grad).numpy(), wanted[0], rtol=1e-10), (x.grad, wanted)
    assert np.allclose(theta.grad.numpy(), wanted[1], rtol=1e-10), (theta.grad, wanted)


def points_in_forward_mode(comm):
    """Tangents of points migrate with them; <A v, y> = <v, A' y>."""
    rng = np.random.default_rng(comm.rank)
    n = 20 + comm.rank
    places = wp.array(rng.random(n), dtype=wp.float64)

    def moved(q):
        particles = wd.Particles(((0.0,), (1.0,)), 0.05, comm)
        x, found = particles.migrate(places, q)
        particles.ghosts(x)
        wide = particles.halo(found)
        return particles.push(wide * wide)

    q, v = split(rng, n), split(rng, n, False)
    tangent = wp.autograd.jvp(moved, [q], [v])
    h = 1e-6
    ends = [
        moved(wp.array(q.numpy() + s * h * v.numpy(), dtype=wp.float64)).numpy() for s in (1, -1)
    ]
    assert np.allclose(tangent.numpy(), (ends[0] - ends[1]) / (2 * h), rtol=1e-7, atol=1e-9)
    y = split(rng, tangent.size, False)
    with wp.Tape() as tape:
        z = moved(q)
    tape.backward(grads={z: y})
    left = sum(comm.gather_objects(float(tangent.numpy() @ y.numpy())))
    right = sum(comm.gather_objects(float(v.numpy() @ q.grad.numpy())))
    assert np.isclose(left, right, rtol=1e-12), (left, right)


def products_in_forward_mode(comm):
    """Sparse products over ranks: the tangent is the product with the tangent."""
    import solver_checks

    rows, columns, values, right = solver_checks.poisson()
    graph = wd.Graph(rows, columns, by="rows", comm=comm)
    A = wd.Matrix(graph, rows, columns, values, dtype=wp.float64)
    own = np.asarray(right, float)[graph.numbers][graph.first :][: graph.owned]
    x, v = wp.array(own, dtype=wp.float64), wp.array(own[::-1].copy(), dtype=wp.float64)
    found = wp.autograd.jvp(lambda x: wd.bsr_mv(A, x), [x], [v]).numpy()
    assert np.array_equal(found, wd.bsr_mv(A, v).numpy())


def disagreement_in_forward_mode(comm):
    """Ranks of which some take no tangents are told, and none waits."""
    if comm.size == 1:
        return
    x, v = wp.ones(3, dtype=wp.float64), wp.ones(3, dtype=wp.float64)
    blocks = wd.Blocks((8 * comm.size,), 1, True, ranks=(comm.size,), comm=comm)
    f = blocks.zeros(wp.float64)

    def halo(f):
        blocks.halo(f)
        return f

    for function, one, along in (
        (lambda x: wd.all_reduce(wp.clone(x)), x, v),
        (halo, f, blocks.zeros(wp.float64)),
    ):

        def run(function=function, one=one, along=along):
            if comm.rank == 0:
                function(one)
            else:
                wp.autograd.jvp(function, [one], [along])

        checking.fails(run, f"rank {comm.rank}", "forward mode along 1", "on all ranks")


def many_fields_on_a_tape(comm):
    """A tape keeps the exchanges of more fields than are kept otherwise."""
    blocks = wd.Blocks((4 * comm.size,), 1, True, ranks=(comm.size,), comm=comm)
    fields = [blocks.zeros(wp.float64, requires_grad=True) for _ in range(80)]
    ends = [wp.zeros(1, dtype=wp.float64, requires_grad=True) for _ in fields]
    with wp.Tape() as tape:
        for x, end in zip(fields, ends, strict=True):
            blocks.halo(x)
            wp.copy(end, x[0:1])
    tape.backward(grads={end: wp.ones_like(end) for end in ends})
    for number, x in enumerate(fields):
        wanted = np.zeros(blocks.local)
        # The ghost is the last cell of the rank below.
        wanted[-2] = 1.0
        assert np.array_equal(x.grad.numpy(), wanted), (number, x.grad)


CHECKS = [
    *(linear_operations, extrema_and_products, derivatives_along_directions, second_derivatives),
    *(tangents_on_tapes, points_in_forward_mode, products_in_forward_mode),
    *(disagreement_in_forward_mode, many_fields_on_a_tape),
]
