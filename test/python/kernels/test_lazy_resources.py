"""Resources of launches that wait for their code stay until these run, whoever drops them.

The programs run on the driver of the unit tests, which loads no code while its gate is closed,
whose memory is that of the host, and which notes the order of what it is given.
"""

import pytest

import programs

BEGIN = """
import ctypes, gc, os, sys
import numpy as np
import warp as wp
from warp import _native
driver = ctypes.CDLL(os.environ["WARP_CUDA_DRIVER"])
driver.fakeCudaTakeOrder.restype = ctypes.c_char_p

def gate(is_open):
    driver.fakeCudaSetGate(ctypes.c_bool(is_open))

def order():
    return driver.fakeCudaTakeOrder().decode().split()

wp.set_device("cuda:0")
wp.zeros(10, dtype=float).numpy()
"""


@pytest.fixture
def fake(tmp_path):
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    return {"WARP_CACHE_PATH": tmp_path / "cache", "WARP_CUDA_DRIVER": programs.FAKE_CUDA}


def run(program, environment):
    status, out, err = programs.run(programs.write_program(BEGIN + program), **environment)
    assert status == 0, err
    return out.splitlines()


HANDLES = {
    "mesh": (
        "wp.Mesh(points, indices, bvh_constructor='sah')",
        "x[i] = wp.mesh_query_point(h, wp.vec3(0.0), 1.0).sign",
    ),
    "bvh": (
        "wp.Bvh(points, points, constructor='sah')",
        "q = wp.bvh_query_aabb(h, wp.vec3(0.0), wp.vec3(1.0))\n"
        "    k = int(0)\n"
        "    while wp.bvh_query_next(q, k):\n"
        "        x[i] = float(k)",
    ),
    "grid": (
        "wp.HashGrid(4, 4, 4)",
        "x[i] = float(wp.hash_grid_point_id(h, i))",
    ),
    "volume": (
        "wp.Volume.load_from_numpy(np.ones((8, 8, 8), np.float32))",
        "x[i] = wp.volume_sample_f(h, wp.vec3(1.0), wp.Volume.LINEAR)",
    ),
}


@pytest.mark.parametrize("kind", HANDLES)
def test_geometry(fake, kind):
    """The words behind the handle, and its memory, go behind the launch."""
    make, use = HANDLES[kind]
    program = f"""
points = wp.array(np.eye(3, dtype=np.float32), dtype=wp.vec3)
indices = wp.array([0, 1, 2], dtype=int)
thing = {make}
word = ctypes.c_uint64.from_address(thing.id & ((1 << 49) - 1))

@wp.kernel
def search(h: wp.uint64, x: wp.array(dtype=float)):
    i = wp.tid()
    {use}

x = wp.zeros(100, dtype=float)
wp.synchronize()
before = word.value
order()
gate(False)
wp.launch(search, 100, [thing.id, x])
del thing, points, indices
gc.collect()
print(_native.queued_operations() > 1, word.value == before != 0, order())
gate(True)
wp.synchronize()
after = order()
print(word.value, after[0], "free" in after)
"""
    assert run(program, fake) == ["True True []", "0 launch True"]


def test_refits_come_behind_launches(fake):
    """A launch that waits searches the hierarchy as it was, and the next one the new one."""
    program = """
points = wp.array(np.eye(3, dtype=np.float32), dtype=wp.vec3)
mesh = wp.Mesh(points, wp.array([0, 1, 2], dtype=int), bvh_constructor="sah")
slot = (ctypes.c_char * 256).from_address(mesh.id & ((1 << 49) - 1))

@wp.kernel
def search(h: wp.uint64, x: wp.array(dtype=float)):
    x[wp.tid()] = wp.mesh_query_point(h, wp.vec3(0.0), 1.0).sign

x = wp.zeros(100, dtype=float)
mesh.refit()
wp.synchronize()
order()
mesh.refit()
alone = order()
gate(False)
before = bytes(slot)
wp.launch(search, 100, [mesh.id, x])
points.assign(np.array([[0, 0, 1], [1, 5, 0], [0, 1, 0]], np.float32))
mesh.refit()
wp.launch(search, 100, [mesh.id, x])
print(bytes(slot) == before, order())
gate(True)
wp.synchronize()
print(len(alone) > 0, order() == ["launch", "upload", *alone, "launch"])
"""
    assert run(program, fake) == ["True []", "True True"]


ARGUMENTS = {
    "array": ("x: wp.array(dtype=float)", "x[i] = 1.0", "wp.zeros(100)"),
    "struct": ("x: Pair", "x.a[i] = x.b[i]", "pair()"),
    "host": ("x: wp.array(dtype=float)", "x[i] = 1.0", "wp.array(np.ones(100, np.float32))"),
    "view": ("x: wp.array2d(dtype=float)", "x[i, 0] = 1.0", "wp.zeros((100, 8))[:, 1:2]"),
    "indexed": (
        "x: wp.indexedarray(dtype=float)",
        "x[i] = 1.0",
        "wp.zeros(100)[wp.array(list(range(100)), dtype=int)]",
    ),
    "gradient": (
        "x: wp.array(dtype=float)",
        "x[i] = x[i] * 2.0",
        "wp.zeros(100, requires_grad=True)",
    ),
    "texture": (
        "x: wp.Texture2D, y: wp.array(dtype=float)",
        "y[i] = wp.texture_sample(x, wp.vec2(0.5), dtype=float)",
        "wp.Texture2D(np.ones((8, 8), np.float32)), wp.zeros(100)",
    ),
}


@pytest.mark.parametrize("how", ["launch", "command"])
@pytest.mark.parametrize("kind", ARGUMENTS)
def test_arguments(fake, kind, how):
    """Memory that nobody has a name for is freed behind the launch that uses it."""
    parameters, body, value = ARGUMENTS[kind]
    program = f"""
@wp.struct
class Pair:
    a: wp.array(dtype=float)
    b: wp.array(dtype=float)

def pair():
    made = Pair()
    made.a, made.b = wp.zeros(100), wp.zeros(100)
    return made

@wp.kernel
def use({parameters}):
    i = wp.tid()
    {body}

wp.synchronize()
order()
gate(False)
command = wp.launch(use, 100, [{value}], record_cmd={how == "command"})
if command:
    command.launch()
    del command
gc.collect()
known = order()
print(_native.queued_operations() > 1, "launch" in known, "free" in known)
gate(True)
wp.synchronize()
after = order()
print(after[0], "free" in after)
"""
    assert run(program, fake) == ["True False False", "launch True"]


def test_kernels_and_streams(fake):
    """A kernel, its module, a stream and events may go; what they were used for happens."""
    program = """
def make(number):
    @wp.kernel(module="unique")
    def add(x: wp.array(dtype=float)):
        x[wp.tid()] += float(wp.static(number))
    return add

x = wp.zeros(100, dtype=float)
stream = wp.Stream("cuda:0")
wp.synchronize()
order()
gate(False)
kernel = make(1)
wp.launch(kernel, 100, [x])
event = wp.record_event()
wp.wait_event(event)
del kernel, event
gc.collect()
print(_native.queued_operations(), order())
gate(True)
wp.synchronize()
print(order())
gate(False)
wp.launch(make(2), 100, [x], stream=stream)
import threading
threading.Timer(0.2, lambda: gate(True)).start()
del stream
gc.collect()
print(_native.queued_operations(), order()[0])
"""
    out = run(program, fake)
    assert out[0] == "4 []"
    assert out[1] == "['launch', 'record', 'wait']"
    assert out[2] == "0 launch"


def test_graphs(fake):
    """Kernels of a capture are compiled beside each other; it has all of them at its end."""
    program = """
def make(number):
    @wp.kernel(module="unique")
    def add(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        x[wp.tid()] += y[wp.tid()] * float(wp.static(number))
    return add

x, y = wp.zeros(100, dtype=float), wp.zeros(100, dtype=float)
for optimize in (False, True):
    gate(False)
    with_capture = wp.ScopedCapture(optimize=optimize)
    with with_capture as capture:
        for n in range(3):
            wp.launch(make(n), 100, [x, wp.zeros(100, dtype=float)])
            y.zero_()
            wp.copy(x, y)
        gc.collect()
        print(_native.queued_operations() >= 9)
        gate(True)
    print(capture.graph.node_count >= 9, _native.queued_operations())
    order()
    wp.capture_launch(capture.graph)
    print(len(order()) > 0)
"""
    assert run(program, fake) == ["True", "True 0", "True"] * 2


@pytest.mark.parametrize(
    "what",
    [
        "wp.get_stream().cuda_stream",
        "wp.Event().cuda_event",
        "wp.array(ptr=pinned.ptr, shape=10, dtype=float)",
        "wp.array(ptr=x.ptr, shape=10, dtype=float, deleter=print)",
        "x.__cuda_array_interface__",
    ],
)
def test_exchanges_end_the_queue(fake, what):
    """Who has a driver's handle, or owns memory, knows nothing of launches that wait."""
    program = f"""
@wp.kernel
def one(x: wp.array(dtype=float)):
    x[wp.tid()] = 1.0

@wp.kernel
def two(x: wp.array(dtype=float)):
    x[wp.tid()] = 2.0

import threading
x = wp.zeros(100, dtype=float)
pinned = wp.zeros(10, dtype=float, device="cpu", pinned=True)
gate(False)
wp.launch(one, 100, [x])
print(_native.queued_operations())
threading.Timer(0.2, lambda: gate(True)).start()
kept = {what}
print(_native.queued_operations())
wp.launch(two, 100, [x])
print(_native.queued_operations())
"""
    assert run(program, fake)[:3] == ["1", "0", "0"]


def test_addresses_of_own_memory_do_not_end_it(fake):
    """Engines look at the same memory as another type."""
    program = """
@wp.kernel
def one(x: wp.array(dtype=float)):
    x[wp.tid()] = 1.0

x = wp.zeros(100, dtype=float)
gate(False)
wp.launch(one, 100, [x])
y = wp.array(ptr=x.ptr, shape=(10, 10), dtype=float)
y.zero_()
print(_native.queued_operations())
gate(True)
wp.synchronize()
"""
    assert run(program, fake) == ["2"]


def test_bounds_answer_before_the_code(fake):
    """The size of blocks is asked for while code is made, and nobody waits: bounds are promises,
    and without any a thread is taken to have 64 registers."""
    program = """
@wp.kernel(launch_bounds=(64, 8), module_options={"block_dim": 64}, module="unique")
def bounded(x: wp.array(dtype=float)):
    x[wp.tid()] = 1.0

@wp.kernel(module="unique")
def unbounded(x: wp.array(dtype=float)):
    x[wp.tid()] = 2.0

@wp.kernel(launch_bounds=64, module="unique")
def few(x: wp.array(dtype=float)):
    x[wp.tid()] = 3.0

x = wp.zeros(100, dtype=float)
many = wp.get_device().sm_count
gate(False)
print(wp.get_suggested_block_size(bounded) == (64, 8 * many))
wp.launch(bounded, 100, [x], block_dim=64)
print(_native.queued_operations())
print(wp.get_suggested_block_size(unbounded) == (256, 4 * many))
print(wp.get_suggested_block_size(few) == (64, 16 * many))
gate(True)
wp.synchronize()
threads, blocks = wp.get_suggested_block_size(bounded)
print(threads <= 64, blocks > 0, _native.queued_operations())
wp.config.lazy_compile = False
print(len(wp.get_suggested_block_size(unbounded)))
"""
    assert run(program, fake) == ["True", "1", "True", "True", "True True 0", "2"]


def test_bounds_ask_for_no_other_code(fake):
    """Only the code of the launch is made, here for arrays that overlap."""
    program = """
import pathlib

@wp.kernel(launch_bounds=(64, 8), module_options={"block_dim": 64}, module="unique")
def shift(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i + 1]

x = wp.zeros(101, dtype=float)
wp.synchronize()
_native.wait_for_background()
folder = pathlib.Path(os.environ["WARP_CACHE_PATH"])
before = len(list(folder.glob("*.code")))
wp.get_suggested_block_size(shift)
wp.launch(shift, 100, [x, x], block_dim=64)
wp.synchronize()
_native.wait_for_background()
print(len(list(folder.glob("*.code"))) - before)
"""
    assert run(program, fake) == ["1"]


def test_errors_name_kernel_and_line_once(fake):
    """One of many kernels that the compiler refuses: others run, the error comes with the wait."""
    program = """
def make(number):
    @wp.kernel(module="unique")
    def add(x: wp.array(dtype=float)):
        x[wp.tid()] += float(wp.static(number))
    return add

@wp.kernel(module="unique")
def large(y: wp.array2d(dtype=float)):
    t = wp.tile_zeros((1024, 1024), dtype=float)
    t[wp.block_dim(), 0] = 1.0
    wp.tile_store(y, t)

x = wp.zeros(100, dtype=float)
y = wp.zeros((4, 4), dtype=float)
wp.synchronize()
order()
gate(False)
for n in range(70):
    if n in (35, 36):
        wp.launch_tiled(large, dim=1, inputs=[y], block_dim=32)
    else:
        wp.launch(make(n % 7), 100, [x])
gate(True)
try:
    wp.synchronize()
except wp.WarpError as error:
    print("'large'" in str(error) or "large(y" in str(error), "program.py:" in str(error))
wp.synchronize()
print(order().count("launch"))
"""
    assert run(program, fake) == ["True True", "68"]


CONDITIONS = {
    # The condition, and if its first value is known while the launch before it waits.
    "full": ("c = wp.full(1, 2, dtype=int)", True),
    "part": ("c = wp.full(8, 2, dtype=int)[5:6]", True),
    "then another": ("c = wp.full(1, 2, dtype=int); y.zero_()", True),
    "then a free": ("c = wp.full(1, 2, dtype=int); del y; gc.collect()", True),
    "twice": ("c = wp.full(1, 0, dtype=int); c.fill_(2)", True),
    "bytes": (
        "b = wp.full(4, 1, dtype=wp.uint8); c = wp.array(ptr=b.ptr, shape=1, dtype=int)",
        True,
    ),
    "half": (
        "c = wp.full(1, 2, dtype=int); wp.array(ptr=c.ptr, shape=1, dtype=wp.int16).fill_(3)",
        False,
    ),
    "strided": ("both = wp.zeros((2, 2), dtype=int); both[:, 0].fill_(2); c = both[:, 0]", False),
    "then a launch": ("c = wp.full(1, 2, dtype=int); wp.launch(add, 1, [x])", False),
    "then a copy": ("c = wp.full(1, 2, dtype=int); wp.copy(c, y)", False),
}


@pytest.mark.parametrize("kind", CONDITIONS)
def test_loops_begin_while_launches_wait(fake, kind):
    """The first turn of a loop needs no code if a fill has set its condition, and no other does."""
    make, is_known = CONDITIONS[kind]
    program = f"""
@wp.kernel
def add(x: wp.array(dtype=float)):
    x[wp.tid()] += 1.0

import threading
x, y = wp.zeros(100, dtype=float), wp.full(1, 3, dtype=int)
wp.synchronize()
gate(False)
wp.launch(add, 100, [x])
{make}
turns = []

def turn():
    turns.append(_native.queued_operations() > 0)
    wp.launch(add, 1, [x])
    if not turns[1:]:
        threading.Timer(0.2, lambda: gate(True)).start()
    else:
        c.zero_()

if not {is_known}:
    threading.Timer(0.2, lambda: gate(True)).start()
wp.capture_while(c, turn)
print(turns)
"""
    assert run(program, fake) == [str([is_known, False])]


def test_loops_that_a_fill_ends_have_no_turn(fake):
    program = """
@wp.kernel
def add(x: wp.array(dtype=float)):
    x[wp.tid()] += 1.0

x = wp.zeros(100, dtype=float)
wp.synchronize()
gate(False)
wp.launch(add, 100, [x])
c = wp.zeros(1, dtype=int)
turns = []
wp.capture_while(c, lambda: turns.append(1))
wp.capture_if(c, lambda: turns.append(2), lambda: turns.append(3))
print(turns, _native.queued_operations() > 0)
gate(True)
wp.synchronize()
"""
    assert run(program, fake) == ["[3] True"]


def test_versions_are_not_waited_for(fake):
    """A launch that waits for its code counts once, and nobody waits for a version of it."""
    program = """
@wp.kernel
def contacts(x: wp.array(dtype=float), count: int):
    i = wp.tid()
    s = x[i]
    for k in range(count):
        s += wp.sin(s) * wp.cos(s + float(k)) + wp.exp(-s * s)
        s = wp.sqrt(wp.abs(s)) + wp.tan(s) * 0.125 + wp.pow(wp.abs(s), 0.3)
    x[i] = s

x = wp.zeros(100, dtype=float)

def kinds():
    return len(contacts.prepare().schedules(0))

gate(False)
wp.launch(contacts, 100, [x, 0])
gate(True)
wp.synchronize()
_native.wait_for_background()
once = kinds()
for _ in range(2):
    wp.launch(contacts, 100, [x, 0])
    wp.synchronize()
print(once, kinds())
"""
    assert run(program, fake) == ["1 2"]
