"""Threads that wait for others go on, and none reads past the end of an array.

Programs run in a process of their own, which must end in time: a lane that waits for another lane
of its vector would wait for ever, and a read of the page after an array ends the process.
"""

import pytest

from programs import run, write_program

LIMIT = 300
WAITS = {
    "spin lock": """
    while wp.atomic_cas(lock, 0, 0, 1) == 1:
        pass
    total[0] = total[0] + i
    wp.atomic_exch(lock, 0, 0)
""",
    "spin lock that gives up": """
    done = int(0)
    tries = int(0)
    while done == 0 and tries < 100000000:
        if wp.atomic_cas(lock, 0, 0, 1) == 0:
            total[0] = total[0] + i
            wp.atomic_exch(lock, 0, 0)
            done = 1
        tries += 1
""",
    "a lock for each bin": """
    b = i % 4
    while wp.atomic_cas(lock, b, 0, 1) != 0:
        pass
    total[b + 1] = total[b + 1] + i
    wp.atomic_exch(lock, b, 0)
    wp.atomic_add(total, 0, i)
""",
    "in turn": """
    while wp.atomic_add(lock, 0, 0) < i:
        pass
    total[0] = total[0] + i
    wp.atomic_add(lock, 0, 1)
""",
    "tickets": """
    mine = wp.atomic_add(lock, 1, 1)
    while wp.atomic_max(lock, 0, -1) != mine:
        pass
    total[0] = total[0] + i
    wp.atomic_add(lock, 0, 1)
""",
    "maximum by compare and swap": """
    old = wp.atomic_add(total, 0, 0)
    while old < i:
        seen = wp.atomic_cas(lock, 0, old, i)
        if seen == old:
            old = i
        else:
            old = seen
    wp.atomic_add(total, 0, i)
""",
}
WAIT_PROGRAM = """
import sys
import numpy as np
import warp as wp

@wp.kernel(module_options={"mode": sys.argv[1]})
def k(lock: wp.array(dtype=int), total: wp.array(dtype=int)):
    i = wp.tid()
{body}

for n in (1, 15, 16, 17, 64, 500):
    lock, total = (wp.zeros(8, dtype=int, device="cpu") for _ in range(2))
    wp.launch(k, n, [lock, total], device="cpu")
    wp.synchronize_device("cpu")
    assert total.numpy()[0] == n * (n - 1) // 2, (n, total.numpy())
"""
PAGE_PROGRAM = """
import ctypes
import mmap
import sys
import numpy as np
import warp as wp

PAGE = mmap.PAGESIZE
libc = ctypes.CDLL(None, use_errno=True)
keep = []


def guarded(values, dtype, at_end):
    \"""An array on its own pages, between two that can't be read, at their end or begin.\"""
    size = -(-max(values.nbytes, 1) // PAGE) * PAGE
    memory = mmap.mmap(-1, size + 2 * PAGE)
    keep.append(memory)
    begin = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    for address in (begin, begin + PAGE + size):
        assert libc.mprotect(ctypes.c_void_p(address), ctypes.c_size_t(PAGE), 0) == 0
    offset = PAGE + (size - values.nbytes if at_end else 0)
    host = np.frombuffer(memory, values.dtype, values.size, offset).reshape(values.shape)
    host[...] = values
    return wp.array(ptr=begin + offset, shape=values.shape[:1], dtype=dtype, device="cpu")


{kernel}

shapes = {wp.vec3: (3,), wp.vec4: (4,), wp.mat33: (3, 3)}
kinds = [wp.float32, wp.float64, wp.int8, wp.float16, wp.vec3, wp.vec4, wp.mat33]
for dtype in kinds:
    kernel = make(dtype)
    for n in (1, 3, 15, 16, 17, 31, 33, 64, 65, 1000):
        for at_end in (True, False):
            scalar = np.float32 if dtype in shapes else wp.dtype_to_numpy(dtype)
            values = np.arange(n * int(np.prod(shapes.get(dtype, ())))) % 7
            values = values.astype(scalar).reshape((n, *shapes.get(dtype, ())))
            x = guarded(values, dtype, at_end)
            y = guarded(np.zeros_like(values), dtype, at_end)
            order = guarded((np.arange(n, dtype=np.int32)[::-1]).copy(), wp.int32, at_end)
            wp.launch(kernel, n, [x, order, y, n], device="cpu")
            wp.synchronize_device("cpu")
            assert np.array_equal(y.numpy(), expected(values)), (dtype, n, at_end)
"""
KERNELS = {
    "copies": """
def make(dtype):
    @wp.kernel(module_options={"mode": sys.argv[1]})
    def k(x: wp.array(dtype=dtype), order: wp.array(dtype=int), y: wp.array(dtype=dtype), n: int):
        i = wp.tid()
        y[i] = x[i] + x[i]
    return k

def expected(values):
    return values + values
""",
    "gathers": """
def make(dtype):
    @wp.kernel(module_options={"mode": sys.argv[1]})
    def k(x: wp.array(dtype=dtype), order: wp.array(dtype=int), y: wp.array(dtype=dtype), n: int):
        i = wp.tid()
        y[i] = x[order[i]]
    return k

def expected(values):
    return values[::-1]
""",
    "branches": """
def make(dtype):
    @wp.kernel(module_options={"mode": sys.argv[1]})
    def k(x: wp.array(dtype=dtype), order: wp.array(dtype=int), y: wp.array(dtype=dtype), n: int):
        i = wp.tid()
        if i + 1 < n:
            y[i] = x[i + 1] + x[i]
        else:
            y[i] = x[0]
    return k

def expected(values):
    return np.concatenate([values[1:] + values[:-1], values[:1]])
""",
    "loops": """
def make(dtype):
    @wp.kernel(module_options={"mode": sys.argv[1]})
    def k(x: wp.array(dtype=dtype), order: wp.array(dtype=int), y: wp.array(dtype=dtype), n: int):
        i = wp.tid()
        for j in range(wp.min(n - i, 3)):
            if x[i + j] == x[i + j]:
                y[i] = x[i + j]
    return k

def expected(values):
    return values[np.minimum(np.arange(len(values)) + 2, len(values) - 1)]
""",
}


@pytest.mark.parametrize("mode", ["release", "debug"])
@pytest.mark.parametrize("name", WAITS)
def test_threads_that_wait_go_on(name, mode):
    program = write_program(WAIT_PROGRAM, body=WAITS[name].strip("\n"))
    status, _, err = run(program, mode, timeout=LIMIT)
    assert status == 0, err


@pytest.mark.parametrize("mode", ["release", "debug"])
@pytest.mark.parametrize("name", KERNELS)
def test_nothing_beyond_an_array_is_read(name, mode):
    program = write_program(PAGE_PROGRAM, kernel=KERNELS[name])
    status, _, err = run(program, mode, timeout=LIMIT)
    assert status == 0, err
