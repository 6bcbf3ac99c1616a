"""Steps of users' programs as they are written: a launch for each formula, on either package.

Each function returns a step and the arrays that it changes.
"""

import numpy as np

import warp as wp


def directions(speeds):
    """Lattice directions of so many speeds in three dimensions, and their weights."""
    grid = np.array([(i, j, k) for i in (0, 1, -1) for j in (0, 1, -1) for k in (0, 1, -1)])
    length = (grid**2).sum(axis=1)
    if speeds == 19:
        grid, length = grid[length < 3], length[length < 3]
        weights = np.choose(length, (1 / 3, 1 / 18, 1 / 36))
    else:
        weights = np.choose(length, (8 / 27, 2 / 27, 1 / 54, 1 / 216))
    order = np.argsort(length, kind="stable")
    return grid[order], weights[order]


def lattice3(speeds, size):
    """A lattice Boltzmann step: density and velocity, collision, streaming, walls, inflow."""
    grid, weights = directions(speeds)
    opposite = [int(np.flatnonzero((grid == -d).all(axis=1))[0]) for d in grid]
    count = wp.constant(speeds)
    table = wp.constant(wp.types.matrix((speeds, 3), wp.int32)(*grid.ravel().tolist()))
    weight = wp.constant(wp.types.vector(speeds, wp.float32)(*weights.tolist()))
    back = wp.constant(wp.types.vector(speeds, wp.int32)(*opposite))

    @wp.kernel
    def moments(
        f: wp.array4d(dtype=float), rho: wp.array3d(dtype=float), u: wp.array3d(dtype=wp.vec3)
    ):
        x, y, z = wp.tid()
        s = float(0.0)
        m = wp.vec3()
        for q in range(count):
            value = f[q, x, y, z]
            s += value
            m += value * wp.vec3(float(table[q, 0]), float(table[q, 1]), float(table[q, 2]))
        rho[x, y, z] = s
        u[x, y, z] = m / s

    @wp.kernel
    def collide(
        f: wp.array4d(dtype=float),
        rho: wp.array3d(dtype=float),
        u: wp.array3d(dtype=wp.vec3),
        omega: float,
    ):
        x, y, z = wp.tid()
        density = rho[x, y, z]
        v = u[x, y, z]
        rest = 1.0 - 1.5 * wp.dot(v, v)
        for q in range(count):
            a = wp.dot(v, wp.vec3(float(table[q, 0]), float(table[q, 1]), float(table[q, 2])))
            equilibrium = weight[q] * density * (rest + 3.0 * a + 4.5 * a * a)
            f[q, x, y, z] = f[q, x, y, z] + omega * (equilibrium - f[q, x, y, z])

    @wp.kernel
    def stream(f: wp.array4d(dtype=float), g: wp.array4d(dtype=float)):
        x, y, z = wp.tid()
        n = f.shape[1]
        for q in range(count):
            i = (x - table[q, 0] + n) % n
            j = (y - table[q, 1] + n) % n
            k = (z - table[q, 2] + n) % n
            g[q, x, y, z] = f[q, i, j, k]

    @wp.kernel
    def bounce(solid: wp.array3d(dtype=wp.uint8), g: wp.array4d(dtype=float)):
        x, y, z = wp.tid()
        if solid[x, y, z] != wp.uint8(0):
            for q in range(count):
                p = back[q]
                if q < p:
                    value = g[q, x, y, z]
                    g[q, x, y, z] = g[p, x, y, z]
                    g[p, x, y, z] = value

    @wp.kernel
    def inflow(g: wp.array4d(dtype=float), speed: float):
        y, z = wp.tid()
        for q in range(count):
            a = speed * float(table[q, 0])
            g[q, 0, y, z] = weight[q] * (1.0 + 3.0 * a + 4.5 * a * a - 1.5 * speed * speed)

    shape = (size, size, size)
    start = np.broadcast_to(weights.astype(np.float32)[:, None, None, None], (speeds, *shape))
    f = wp.array(start.copy(), dtype=float)
    g, rho, u = wp.zeros_like(f), wp.zeros(shape), wp.zeros(shape, dtype=wp.vec3)
    at = np.indices(shape) - size / 2
    solid = wp.array(((at**2).sum(axis=0) < (size / 6) ** 2).astype(np.uint8))

    def step():
        for a, b in ((f, g), (g, f)):
            wp.launch(moments, shape, [a, rho, u])
            wp.launch(collide, shape, [a, rho, u, 1.2])
            wp.launch(stream, shape, [a, b])
            wp.launch(bounce, shape, [solid, b])
            wp.launch(inflow, (size, size), [b, 0.05])

    return step, [f, g, rho, u]


@wp.kernel
def laplacian(p: wp.array3d(dtype=float), out: wp.array3d(dtype=float)):
    x, y, z = wp.tid()
    n = p.shape[0]
    s = p[wp.max(x - 1, 0), y, z] + p[wp.min(x + 1, n - 1), y, z]
    s += p[x, wp.max(y - 1, 0), z] + p[x, wp.min(y + 1, n - 1), z]
    s += p[x, y, wp.max(z - 1, 0)] + p[x, y, wp.min(z + 1, n - 1)]
    out[x, y, z] = s - 6.0 * p[x, y, z]


@wp.kernel
def integrate(
    p: wp.array3d(dtype=float),
    last: wp.array3d(dtype=float),
    lap: wp.array3d(dtype=float),
    speed: wp.array3d(dtype=float),
    next: wp.array3d(dtype=float),
):
    x, y, z = wp.tid()
    next[x, y, z] = 2.0 * p[x, y, z] - last[x, y, z] + speed[x, y, z] * lap[x, y, z]


@wp.kernel
def absorb(next: wp.array3d(dtype=float), damping: wp.array3d(dtype=float)):
    x, y, z = wp.tid()
    next[x, y, z] = next[x, y, z] * damping[x, y, z]


@wp.kernel
def walls(next: wp.array3d(dtype=float)):
    x, y, z = wp.tid()
    n = next.shape[0]
    if x == 0 or y == 0 or z == 0 or x == n - 1 or y == n - 1 or z == n - 1:
        next[x, y, z] = 0.0


@wp.kernel
def square(next: wp.array3d(dtype=float), intensity: wp.array3d(dtype=float)):
    x, y, z = wp.tid()
    intensity[x, y, z] = intensity[x, y, z] + next[x, y, z] * next[x, y, z]


@wp.kernel
def source(next: wp.array3d(dtype=float), clock: wp.array(dtype=int)):
    n = next.shape[0] // 2
    next[n, n, n] = next[n, n, n] + wp.sin(0.2 * float(clock[0]))
    clock[0] = clock[0] + 1


def wave3(size):
    """A wave equation in three dimensions: absorbing layers, walls, a source and intensities."""
    shape = (size, size, size)
    p = [wp.zeros(shape) for _ in range(3)]
    lap, intensity = wp.zeros(shape), wp.zeros(shape)
    at = np.abs(np.indices(shape) - (size - 1) / 2).max(axis=0) / (size / 2)
    speed = wp.array(np.full(shape, 0.1, dtype=np.float32))
    damping = wp.array(np.where(at > 0.8, 0.97, 1.0).astype(np.float32))
    clock = wp.zeros(1, dtype=int)

    def step():
        for turn in range(3):
            a, b, c = (p[(turn + k) % 3] for k in range(3))
            wp.launch(laplacian, shape, [b, lap])
            wp.launch(integrate, shape, [b, a, lap, speed, c])
            wp.launch(absorb, shape, [c, damping])
            wp.launch(walls, shape, [c])
            wp.launch(source, 1, [c, clock])
            wp.launch(square, shape, [c, intensity])

    return step, [*p, intensity, clock]


INPUTS, HIDDEN, OUTPUTS, ROWS = 16, 32, 4, 32


@wp.kernel
def observe(
    state: wp.array2d(dtype=float), mean: wp.array(dtype=float), obs: wp.array2d(dtype=float)
):
    w, i = wp.tid()
    obs[w, i] = wp.clamp(state[w, i] - mean[i], -5.0, 5.0)


@wp.kernel
def network(
    obs: wp.array2d(dtype=float),
    first: wp.array2d(dtype=float),
    second: wp.array2d(dtype=float),
    action: wp.array2d(dtype=float),
):
    block = wp.tid()
    x = wp.tile_load(obs, shape=(ROWS, INPUTS), offset=(block * ROWS, 0))
    a = wp.tile_load(first, shape=(INPUTS, HIDDEN))
    b = wp.tile_load(second, shape=(HIDDEN, OUTPUTS))
    h = wp.tile_map(wp.tanh, wp.tile_matmul(x, a))
    wp.tile_store(action, wp.tile_matmul(h, b), offset=(block * ROWS, 0))


@wp.kernel
def explore(action: wp.array2d(dtype=float), seed: wp.array(dtype=int), deviation: float):
    w, i = wp.tid()
    rng = wp.rand_init(seed[0], w * OUTPUTS + i)
    action[w, i] = action[w, i] + deviation * wp.randn(rng)


@wp.kernel
def limit(action: wp.array2d(dtype=float)):
    w, i = wp.tid()
    action[w, i] = wp.clamp(action[w, i], -1.0, 1.0)


@wp.kernel
def keep(action: wp.array2d(dtype=float), t: int, actions: wp.array3d(dtype=float)):
    w, i = wp.tid()
    actions[t, w, i] = action[w, i]


@wp.kernel
def simulate(state: wp.array2d(dtype=float), action: wp.array2d(dtype=float)):
    w = wp.tid()
    for i in range(8):
        v = state[w, 8 + i] + 0.02 * (action[w, i % 4] - wp.sin(state[w, i]))
        state[w, 8 + i] = v
        state[w, i] = state[w, i] + 0.02 * v


@wp.kernel
def reward(state: wp.array2d(dtype=float), t: int, rewards: wp.array2d(dtype=float)):
    w = wp.tid()
    s = float(0.0)
    for i in range(16):
        s += state[w, i] * state[w, i]
    rewards[t, w] = wp.exp(-s)


@wp.kernel
def finish(state: wp.array2d(dtype=float), t: int, done: wp.array2d(dtype=int)):
    w = wp.tid()
    done[t, w] = wp.where(wp.abs(state[w, 0]) > 2.0, 1, 0)


@wp.kernel
def restart(done: wp.array2d(dtype=int), t: int, state: wp.array2d(dtype=float)):
    w = wp.tid()
    if done[t, w] == 1:
        for i in range(16):
            state[w, i] = 0.01 * float(i)


@wp.kernel
def count_up(seed: wp.array(dtype=int)):
    seed[0] = seed[0] + 1


@wp.kernel
def advantages(
    rewards: wp.array2d(dtype=float), done: wp.array2d(dtype=int), out: wp.array2d(dtype=float)
):
    w = wp.tid()
    s = float(0.0)
    for k in range(rewards.shape[0]):
        t = rewards.shape[0] - 1 - k
        s = rewards[t, w] + 0.99 * s * (1.0 - float(done[t, w]))
        out[t, w] = s


def rollout(worlds, steps=8):
    """A rollout for policy gradients: observations, a network in tiles, dynamics and rewards."""
    rng = np.random.default_rng(4)

    def normal(*shape):
        return wp.array(rng.normal(size=shape).astype(np.float32) * 0.3)

    state, mean = normal(worlds, INPUTS), normal(INPUTS)
    first, second = normal(INPUTS, HIDDEN), normal(HIDDEN, OUTPUTS)
    obs, action = wp.zeros((worlds, INPUTS)), wp.zeros((worlds, OUTPUTS))
    actions, rewards = wp.zeros((steps, worlds, OUTPUTS)), wp.zeros((steps, worlds))
    done, out = wp.zeros((steps, worlds), dtype=int), wp.zeros((steps, worlds))
    seed = wp.zeros(1, dtype=int)

    def step():
        for t in range(steps):
            wp.launch(observe, (worlds, INPUTS), [state, mean, obs])
            wp.launch_tiled(
                network,
                dim=[worlds // ROWS],
                inputs=[obs, first, second, action],
                block_dim=64,
            )
            wp.launch(explore, (worlds, OUTPUTS), [action, seed, 0.1])
            wp.launch(limit, (worlds, OUTPUTS), [action])
            wp.launch(keep, (worlds, OUTPUTS), [action, t, actions])
            wp.launch(simulate, worlds, [state, action])
            wp.launch(reward, worlds, [state, t, rewards])
            wp.launch(finish, worlds, [state, t, done])
            wp.launch(restart, worlds, [done, t, state])
            wp.launch(count_up, 1, [seed])
        wp.launch(advantages, worlds, [rewards, done, out])

    return step, [state, obs, action, actions, rewards, done, out, seed]
