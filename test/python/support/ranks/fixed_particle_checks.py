"""Checks of particles of fixed capacities: replays of migration and ghosts equal eager steps."""

import checking
import numpy as np

import warp as wp
import warp.distributed as wd

RADIUS = 0.09
COUNT, STEPS = 120, 8


@wp.kernel
def sum_near(
    x: wp.array(dtype=wp.vec2),
    numbers: wp.array(dtype=int),
    own: wp.array(dtype=int),
    all_: wp.array(dtype=int),
    found: wp.array(dtype=int),
):
    """The sum of the numbers of points nearby, which has no order."""
    i = wp.tid()
    if i < own[0]:
        total = int(0)
        for j in range(all_[0]):
            if wp.length(x[i] - x[j]) < RADIUS:
                total += numbers[j]
        found[i] = total


@wp.kernel
def drift(
    x: wp.array(dtype=wp.vec2),
    v: wp.array2d(dtype=float),
    own: wp.array(dtype=int),
    x_out: wp.array(dtype=wp.vec2),
    v_out: wp.array2d(dtype=float),
):
    i = wp.tid()
    if i < own[0]:
        x_out[i] = x[i] + wp.vec2(v[i, 0], v[i, 1]) * 0.05
        for c in range(2):
            v_out[i, c] = wp.where(x[i][c] < 0.0 or x[i][c] > 1.0, -v[i, c], v[i, c])


def _start(comm):
    rng = np.random.default_rng(5)
    x = rng.random((COUNT, 2)).astype(np.float32)
    v = (0.5 * rng.standard_normal((COUNT, 2))).astype(np.float32)
    first, last = wd.rows_of(COUNT, comm.rank, comm.size)
    particles = wd.Particles(((0, 0), (1, 1)), RADIUS, comm, capacity=COUNT)
    x = wp.array(x[first:last], dtype=wp.vec2)
    return particles, *particles.migrate(x, wp.array(v[first:last], dtype=float))


def _whole(comm, numbers, *parts):
    """Rows of all ranks in the order of their numbers."""
    rows = comm.gather_objects([one.numpy() for one in (numbers, *parts)])
    order = np.argsort(np.concatenate([one[0] for one in rows]))
    assert len(order) == COUNT
    return [np.concatenate(one)[order] for one in list(zip(*rows, strict=True))[1:]]


def _eager(comm):
    """Positions and sums by arrays whose sizes change."""
    particles, x, v = _start(comm)
    for _ in range(STEPS):
        x, v = particles.migrate(x, v)
        particles.ghosts(x)
        near, numbers = particles.halo(x, particles.numbers)
        own, all_ = (wp.array([one], dtype=int) for one in (particles.count, near.size))
        found = wp.zeros(particles.count, dtype=int)
        x_out, v_out = wp.empty_like(x), wp.empty_like(v)
        if particles.count:
            wp.launch(sum_near, particles.count, [near, numbers, own, all_, found])
            wp.launch(drift, particles.count, [x, v, own, x_out, v_out])
        x, v = x_out, v_out
    return _whole(comm, particles.numbers, x, v, found)


def fixed_capacities(comm):
    """Bits of captured steps, with owners that change between replays."""
    wanted = _eager(comm)
    particles, x, v = _start(comm)
    fixed = particles.fixed(moving=COUNT // 2)
    x, v = fixed.padded(x, v)
    found = wp.zeros(COUNT, dtype=int)

    def step():
        y, w = fixed.migrate(x, v)
        fixed.ghosts(y)
        near, numbers = fixed.halo(y, fixed.numbers)
        wp.launch(sum_near, COUNT, [near, numbers, fixed.live, fixed.reach, found])
        wp.launch(drift, COUNT, [y, w, fixed.live, x, v])

    # A step at once is the same as its replay.
    step()
    with wp.ScopedCapture() as capture:
        step()
    for k in range(1, STEPS):
        if k == 4:
            particles.balance(x[: fixed.check()])
        wp.capture_launch(capture.graph)
    count = fixed.check()
    assert count == particles.count == particles.numbers.size
    results = _whole(comm, particles.numbers, x[:count], v[:count], found[:count])
    for one, other in zip(results, wanted, strict=True):
        assert np.array_equal(one, other)
    # The points go on with arrays whose sizes change.
    moved, _ = particles.migrate(x[:count], v[:count])
    assert moved.size == particles.count
    return checking.digest(results[0])


def fixed_adjoints(comm):
    """<A x, y> = <x, A' y> of migration and halo, after other steps have used their memory."""
    rng = np.random.default_rng(comm.rank)
    particles, x, v = _start(comm)
    fixed = particles.fixed()
    x = fixed.padded(x)
    q = wp.array(rng.random((COUNT, 3)), dtype=wp.float64, requires_grad=True)
    wp.launch(drift, COUNT, [x, fixed.padded(v), fixed.live, x, wp.empty((COUNT, 2), dtype=float)])
    before = fixed.live.numpy()[0]
    with wp.Tape() as tape:
        x, moved = fixed.migrate(x, q)
        fixed.ghosts(x)
        wide = fixed.halo(moved)
    rows = fixed.reach.numpy()[0]
    fixed.check()
    out = wide.numpy()[:rows]
    y = rng.random(wide.shape)
    y[rows:] = 0.0
    # Index lists of a tape stay as they were.
    fixed.migrate(x)
    fixed.ghosts(x)
    tape.backward(grads={wide: wp.array(y, dtype=wp.float64)})
    grad = q.grad.numpy()
    assert not grad[before:].any() and (comm.size == 1 or grad[:before].any())
    left = sum(comm.gather_objects(float((out * y[:rows]).sum())))
    right = sum(comm.gather_objects(float((q.numpy() * grad).sum())))
    assert np.isclose(left, right, rtol=1e-12), (left, right)


def bad_fixed_particles(comm):
    """Points that do not fit, read after the replay, and wrong calls: one line on all ranks."""
    who = f"rank {comm.rank}"
    free = wd.Particles(((0, 0), (1, 1)), RADIUS, comm)
    checking.fails(free.fixed, who, "capacity=n")
    particles, x, _ = _start(comm)
    for wrong in (0, 2.5, "a"):
        checking.fails(lambda moving=wrong: particles.fixed(moving), who, "'moving'", "integer")
    fixed = particles.fixed(moving=1, near=1)
    checking.fails(lambda: fixed.migrate(x[:1]), who, f"{COUNT} rows", "padded")
    checking.fails(lambda: fixed.padded(wp.zeros(COUNT + 1)), who, f"{particles.count} rows")
    y = fixed.padded(x)
    checking.fails(lambda: fixed.halo(y), who, "`ghosts`")
    with wp.ScopedCapture() as capture:
        moved = fixed.migrate(y)[0]
        fixed.ghosts(moved)
    assert fixed.check() == particles.count
    with wp.ScopedCapture():
        checking.fails(lambda: particles.migrate(y), who, "in a capture", "particles.fixed()")
    # All points go to the owner of the last corner.
    y.fill_(wp.vec2(0.99, 0.99))
    wp.capture_launch(capture.graph)
    if comm.size > 1:
        checking.fails(fixed.check, who, "migrate: rank ", "of at most 1: raise `moving`")
    room = max(3 * comm.size - 1, 3)
    few = wd.Particles(((0, 0), (1, 1)), RADIUS, comm, capacity=room)
    (z,) = few.migrate(wp.array(np.full((3, 2), (comm.rank + 0.5) / comm.size), dtype=wp.vec2))
    fixed = few.fixed()
    z = fixed.padded(z)
    with wp.ScopedCapture() as capture:
        fixed.migrate(z)
    z.fill_(wp.vec2(0.5, 0.5))
    wp.capture_launch(capture.graph)
    if comm.size > 1:
        text = f"received {3 * comm.size} of at most {room}: raise `capacity`"
        checking.fails(fixed.check, who, "migrate: rank ", text)
    if comm.rank == comm.size - 1:
        z.fill_(wp.vec2(0.5, float("nan")))
    fixed.live.fill_(1)
    wp.capture_launch(capture.graph)
    checking.fails(fixed.check, who, f"point 0 of rank {comm.size - 1}", "NaN")


CHECKS = [fixed_capacities, fixed_adjoints, bad_fixed_particles]

if __name__ == "__main__":
    checking.run(CHECKS)
