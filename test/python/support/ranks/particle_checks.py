"""Checks of particles that migrate, with ghosts: the same bits on any number of ranks."""

import checking
import numpy as np

import warp as wp
import warp.distributed as wd

RADIUS = wp.constant(0.04)


@wp.kernel
def advance(
    grid: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
    numbers: wp.array(dtype=int),
    dt: float,
    x_out: wp.array(dtype=wp.vec3),
    v_out: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    # Neighbours by rising number, so that sums have one order on any number of ranks.
    ids = wp.types.vector(32, wp.int32)()
    at = wp.types.vector(32, wp.int32)()
    count = int(0)
    for j in wp.hash_grid_query(grid, x[i], 2.0 * RADIUS):
        d = x[i] - x[j]
        if j != i and wp.dot(d, d) < 4.0 * RADIUS * RADIUS and count < 32:
            k = int(count)
            while k > 0 and ids[wp.max(k - 1, 0)] > numbers[j]:
                ids[k] = ids[k - 1]
                at[k] = at[k - 1]
                k = k - 1
            ids[k] = numbers[j]
            at[k] = j
            count = count + 1
    force = wp.vec3(0.0, -1.0, 0.0)
    for k in range(count):
        d = x[i] - x[at[k]]
        r = wp.length(d)
        if r > 0.0:
            force = force + d / r * (2.0 * RADIUS - r) * 2000.0 - (v[i] - v[at[k]]) * 0.5
    w = v[i] + force * dt
    p = x[i] + w * dt
    for c in range(2):
        if p[c] < 0.0:
            p[c] = -p[c]
            w[c] = -w[c]
        if p[c] > 1.0:
            p[c] = 2.0 - p[c]
            w[c] = -w[c]
    x_out[i] = p
    v_out[i] = w


def discs(comm):
    """Bits of positions after steps with migration, ghosts and balance."""
    n, steps = 240, 16
    rng = np.random.default_rng(5)
    x = np.zeros((n, 3), np.float32)
    v = np.zeros((n, 3), np.float32)
    x[:, :2], v[:, :2] = rng.random((n, 2)), 3 * rng.standard_normal((n, 2))
    first, last = wd.rows_of(n, comm.rank, comm.size)
    x, v = (wp.array(one[first:last], dtype=wp.vec3) for one in (x, v))
    particles = wd.Particles(((0, 0), (1, 1)), 2 * 0.04 * 1.001, comm)
    grid = wp.HashGrid(16, 16, 1, device=comm.device)
    moved = 0
    for step in range(steps):
        if step % 5 == 1:
            particles.balance(x)
        before = set() if particles.numbers is None else set(particles.numbers.list())
        x, v = particles.migrate(x, v)
        moved += len(before - set(particles.numbers.list()))
        particles.ghosts(x)
        everything = particles.halo(x, v, particles.numbers)
        assert sorted(set(everything[2].list())) == sorted(everything[2].list())
        x_out, v_out = (wp.empty(particles.count, dtype=wp.vec3) for _ in range(2))
        if particles.count:
            grid.build(everything[0], 0.08)
            inputs = [grid.id, *everything, 2e-3, x_out, v_out]
            wp.launch(advance, particles.count, inputs)
        x, v = x_out, v_out
    parts = comm.gather_objects((particles.numbers.numpy(), x.numpy(), v.numpy(), moved))
    numbers = np.concatenate([one[0] for one in parts])
    order = np.argsort(numbers)
    assert np.array_equal(numbers[order], np.arange(n))
    assert comm.size == 1 or sum(one[3] for one in parts) > 10
    loads = [len(one[0]) for one in parts]
    assert max(loads) < 2 * n / comm.size + 20, loads
    return checking.digest(np.concatenate([np.c_[one[1], one[2]] for one in parts])[order])


def migration_adjoint(comm):
    """<migrate x, y> = <x, migrate' y>; the same for halo and push."""
    rng = np.random.default_rng(comm.rank)
    particles = wd.Particles(((0.0,), (1.0,)), 0.05, comm)
    x = wp.array(rng.random(20 + comm.rank), dtype=wp.float64)
    q = wp.array(rng.random(20 + comm.rank), dtype=wp.float64, requires_grad=True)
    with wp.Tape() as tape:
        x, moved = particles.migrate(x, q)
        ghosts = particles.ghosts(x)
        wide = particles.halo(moved)
    assert wide.size == particles.count + ghosts
    y = wp.array(rng.random(wide.size), dtype=wp.float64)
    tape.backward(grads={wide: y})
    left = sum(comm.gather_objects(float(wide.numpy() @ y.numpy())))
    right = sum(comm.gather_objects(float(q.numpy() @ q.grad.numpy())))
    assert np.isclose(left, right, rtol=1e-12)
    whole = np.sort(np.concatenate(comm.gather_objects(x.numpy())))
    mine = x.numpy()
    for value in mine[:3]:
        # Every point within the radius is here.
        near = whole[np.abs(whole - value) < 0.05]
        assert set(near.tolist()) <= set(particles.halo(x).list())
    ones = wp.full(wide.size, 1.0, dtype=wp.float64)
    total = sum(comm.gather_objects(float(particles.push(ones).numpy().sum())))
    assert total == sum(comm.gather_objects(wide.size))


def bad_particles(comm):
    """NaN positions, too many points, wrong arrays: each one line, on all ranks."""
    who = f"rank {comm.rank}"
    checking.fails(lambda: wd.Particles(((0, 0), (1, 0)), 0.1), who, "corners")
    checking.fails(lambda: wd.Particles(((0, 0), (1, np.inf)), 0.1), who, "finite corners")
    checking.fails(lambda: wd.Particles(((0, 0), (1, 1)), -1.0), who, "-1.0")
    checking.fails(lambda: wd.Particles(((0, 0), (1, 1)), 0.1, by="luck"), who, "'luck'")
    if comm.size > 1:
        checking.fails(lambda: wd.Particles(((0, 0), (1, 1)), 2.0), who, "fewer ranks")
    data = np.full((4, 3), 0.5, np.float32)
    particles = wd.Particles(((0, 0), (1, 1)), 0.1, capacity=4 * comm.size - 1)
    x = wp.array(data, dtype=wp.vec3)
    checking.fails(lambda: particles.migrate(x), who, f"of at most {4 * comm.size - 1}", "balance")
    checking.fails(lambda: particles.migrate(x, wp.zeros(3)), who, "4 rows")
    for load in (np.ones(3), np.full(4, np.nan), np.full(4, -1.0)):
        given = load if comm.rank == comm.size - 1 else None
        checking.fails(lambda given=given: particles.balance(x, given), who, "weight", "at least 0")
    checking.fails(lambda: particles.halo(x), who, "`ghosts`")
    checking.fails(lambda: particles.migrate(wp.zeros(4)), who, "2 coordinates")
    if comm.rank == comm.size - 1:
        data[2, 1] = np.nan
    y = wp.array(data, dtype=wp.vec3)
    checking.fails(lambda: particles.migrate(y), who, "NaN", "1 in all")
    # Points outside count to the nearest cell.
    outside = wp.array(np.full((1, 3), 9.0 + comm.rank, np.float32), dtype=wp.vec3)
    far = wd.Particles(((0, 0), (1, 1)), 0.1, comm)
    (found,) = far.migrate(outside)
    assert found.size in (0, comm.size)


CHECKS = [discs, migration_adjoint, bad_particles]
