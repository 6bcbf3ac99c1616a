"""A CUDA device in trouble: no memory left, kernels that fault, forks, many threads."""

import threading

import numpy as np
import pytest

import warp as wp
from programs import run, write_program

pytestmark = pytest.mark.cuda
CARD = "cuda:0"


@wp.kernel
def steps(x: wp.array(dtype=float), by: float):
    i = wp.tid()
    x[i] = 0.5 * x[i] + by


@wp.kernel
def count(total: wp.array(dtype=int)):
    wp.atomic_add(total, 0, 1)


def test_sixteen_threads_launch_at_once():
    size, rounds, workers = 10_000, 40, 16
    total = wp.zeros(1, dtype=int, device=CARD)
    wp.synchronize_device(CARD)
    start, results, failures = threading.Barrier(workers), {}, []

    def work(number):
        try:
            start.wait()
            stream = wp.Stream(CARD)
            with wp.ScopedStream(stream):
                x = wp.full(size, number, dtype=float, device=CARD)
                for step in range(rounds):
                    wp.launch(steps, size, [x, float(step)], device=CARD)
                    wp.launch(count, size, [total], device=CARD)
                    extra = wp.zeros(size, dtype=float, device=CARD)
                    wp.copy(extra, x)
                results[number] = (x.numpy(), extra.numpy())
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    for number in range(workers):
        value = np.float32(number)
        for step in range(rounds):
            value = np.float32(0.5) * value + np.float32(step)
        for array in results[number]:
            np.testing.assert_allclose(array, value, rtol=1e-6)
    wp.synchronize_device(CARD)
    assert total.numpy()[0] == workers * rounds * size


def test_out_of_memory_names_request_and_free():
    memory = wp.get_device(CARD).total_memory
    kept = wp.full(1000, 7.0, dtype=float, device=CARD)
    with pytest.raises(MemoryError, match=r"(?s)'cuda:0'.*requested .* free "):
        wp.empty((memory >> 28, 1 << 27), dtype=float, device=CARD)
    assert (kept.numpy() == 7.0).all()
    wp.launch(steps, 1000, [kept, 1.0], device=CARD)
    assert (kept.numpy() == 4.5).all()


def test_memory_comes_back():
    """More than the card holds, a piece at a time."""
    device = wp.get_device(CARD)
    piece = device.total_memory // 4
    for value in range(6):
        x = wp.empty((piece >> 12, 1 << 10), dtype=float, device=CARD)
        x[-1].fill_(float(value))
        assert x[-1].numpy()[-1] == value
        del x


PROGRAM = """
import os, sys
import warp as wp

wp.config.quiet = True

@wp.kernel
def poke(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 1.0

def main():
{body}

if __name__ == "__main__":
    main()
"""

FAULT = """
    wild = wp.array(ptr=4096, shape=64, dtype=float, device="cuda:0")
    try:
        wp.launch(poke, 64, [wild], device="cuda:0")
        wp.synchronize_device("cuda:0")
    except RuntimeError as error:
        print("first:", error)
    try:
        wp.zeros(4, dtype=float, device="cuda:0").numpy()
    except RuntimeError as error:
        print("later:", error)
    here = wp.zeros(4, dtype=float, device="cpu")
    wp.launch(poke, 4, [here], device="cpu")
    print("here:", here.numpy().sum())
"""

FORK = """
    x = wp.zeros(4, dtype=float, device="cuda:0")
    wp.launch(poke, 4, [x], device="cuda:0")
    wp.synchronize()
    child = os.fork()
    if child == 0:
        code = 1
        try:
            wp.zeros(4, dtype=float, device="cuda:0")
            wp.synchronize_device("cuda:0")
        except RuntimeError as error:
            print("child:", error, flush=True)
            code = 0
        here = wp.zeros(4, dtype=float, device="cpu")
        wp.launch(poke, 4, [here], device="cpu")
        print("here:", here.numpy().sum(), flush=True)
        os._exit(code)
    print("status:", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    wp.launch(poke, 4, [x], device="cuda:0")
    print("parent:", x.numpy().sum())
"""

SPAWN = """
    x = wp.zeros(4, dtype=float, device="cuda:0")
    if len(sys.argv) == 1:
        import subprocess
        wp.launch(poke, 4, [x], device="cuda:0")
        children = [subprocess.Popen([sys.executable, __file__, "child"]) for _ in range(4)]
        print("status:", [child.wait() for child in children])
    wp.launch(poke, 4, [x], device="cuda:0")
    sys.stdout.write(f"sum: {x.numpy().sum()}\\n")
"""


def printed(body):
    """Output of a program of its own."""
    status, out, err = run(write_program(PROGRAM, body=body))
    assert status == 0, err
    return out


def test_fault_names_the_kernel_and_the_process_goes_on():
    output = printed(FAULT)
    first = output.partition("later:")[0]
    assert "first:" in first and "faulted" in first and "'poke'" in first
    assert "later:" in output and "here: 4.0" in output


def test_forked_child_is_told():
    output = printed(FORK)
    assert "child:" in output and "'spawn'" in output
    assert "here: 4.0" in output and "status: 0" in output and "parent: 4.0" in output


def test_new_processes_share_the_card():
    output = printed(SPAWN)
    assert "status: [0, 0, 0, 0]" in output and output.count("sum: 4.0") == 5
