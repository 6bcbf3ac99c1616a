"""Code of constant tables: lanes, memory spaces of GPUs, lasting names."""

import numpy as np
import pytest

import warp as wp
from warp._src.kernels.identity import of_value

Lattice = wp.types.vector(length=27, dtype=wp.float32)
Shifts = wp.types.matrix(shape=(3, 27), dtype=wp.int32)
C = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]).T
W = np.array([8, 2, 0.5, 0.125])[np.abs(C).sum(axis=0)] / 27
weights = wp.constant(Lattice(*W.tolist()))
shifts = wp.constant(Shifts(*C.astype(int).ravel().tolist()))


@wp.kernel
def collide(f: wp.array2d(dtype=float), g: wp.array2d(dtype=float), n: int):
    """One step of a D3Q27 lattice on a periodic cube of n cells a side."""
    x, y, z = wp.tid()
    rho = float(0.0)
    u = wp.vec3(0.0, 0.0, 0.0)
    held = Lattice()
    for q in range(27):
        a = (x - shifts[0, q] + n) % n
        b = (y - shifts[1, q] + n) % n
        c = (z - shifts[2, q] + n) % n
        held[q] = f[q, (a * n + b) * n + c]
        rho += held[q]
        u += held[q] * wp.vec3(float(shifts[0, q]), float(shifts[1, q]), float(shifts[2, q]))
    u = u / rho
    for q in range(27):
        e = wp.vec3(float(shifts[0, q]), float(shifts[1, q]), float(shifts[2, q]))
        eu = 3.0 * wp.dot(e, u)
        balance = rho * weights[q] * (1.0 + eu + 0.5 * eu * eu - 1.5 * wp.dot(u, u))
        g[q, (x * n + y) * n + z] = held[q] - 0.7 * (held[q] - balance)


def step(f, n):
    f = f.astype(np.float64).reshape(27, n, n, n)
    held = np.stack([np.roll(f[q], C[:, q], axis=(0, 1, 2)) for q in range(27)])
    rho = held.sum(axis=0)
    u = np.tensordot(C, held, (1, 0)) / rho
    eu = 3 * np.tensordot(C.T, u, (1, 0))
    balance = rho * W[:, None, None, None] * (1 + eu + eu**2 / 2 - 1.5 * (u**2).sum(axis=0))
    return (held - 0.7 * (held - balance)).reshape(27, -1)


def test_a_lattice_step_is_that_of_numpy(device):
    n = 9
    f = np.random.default_rng(3).uniform(0.5, 1.5, size=(27, n**3)).astype(np.float32)
    out = wp.zeros((27, n**3), dtype=float, device=device)
    wp.launch(collide, (n, n, n), [wp.array(f, device=device), out, n], device=device)
    np.testing.assert_allclose(out.numpy(), step(f, n), rtol=2e-5, atol=1e-6)


def test_a_lattice_step_needs_no_thread_memory():
    assert ".local" not in collide.ir("ptx", arch=90)
    assert "warp.scratch" not in collide.ir("thread")


@wp.kernel
def uniform(x: wp.array(dtype=float), o: wp.array(dtype=float), n: int):
    t = wp.tid()
    for q in range(n):
        o[t] += weights[q] * x[t]


@wp.kernel
def divergent(x: wp.array(dtype=int), o: wp.array(dtype=float)):
    o[wp.tid()] = weights[x[wp.tid()]]


def test_memory_of_a_gpu_follows_the_index():
    """Constant memory for one index of a warp, the read-only path for many."""
    one, many = uniform.ir("ptx", arch=90), divergent.ir("ptx", arch=90)
    assert "ld.const.b32" in one and ".local" not in one
    assert "ld.global.nc" in many and ".const" not in many and ".local" not in many


@pytest.mark.parametrize("count", [1, 7, 16, 100])
def test_lanes_read_an_element_each(count):
    k = np.random.default_rng(count).integers(0, 27, size=count).astype(np.int32)
    out = wp.zeros(count, dtype=float, device="cpu")
    wp.launch(divergent, count, [wp.array(k, device="cpu"), out], device="cpu")
    np.testing.assert_array_equal(out.numpy(), W.astype(np.float32)[k])
    assert "masked.gather" in divergent.ir("llvm")


CODES = np.array([[3, -1, 4], [1, -5, 9]], np.int16)
BITS = np.array([True, False, False, True, True])


@wp.kernel
def choose(x: wp.array(dtype=int), o: wp.array(dtype=int)):
    t = wp.tid()
    k = x[t]
    o[t] = int(CODES[k % 2, k % 3])
    if BITS[k % 5]:
        o[t] += 100


@pytest.mark.parametrize("count", [1, 33, 200])
def test_lanes_choose_among_few(count, device):
    k = np.arange(count, dtype=np.int32)
    out = wp.zeros(count, dtype=int, device=device)
    wp.launch(choose, count, [wp.array(k, device=device), out], device=device)
    assert out.numpy().tolist() == (CODES[k % 2, k % 3] + 100 * BITS[k % 5]).tolist()
    assert "masked.gather" not in choose.ir("llvm", device="cpu")


def test_the_lasting_name_is_that_of_the_numbers():
    table = np.arange(6.0)
    names = [
        of_value(one)[0]
        for one in (table, table.copy(), table + 1, table.reshape(2, 3), table.astype(np.float32))
    ]
    assert None not in names
    assert names[0] == names[1]
    assert len(set(names)) == 4
