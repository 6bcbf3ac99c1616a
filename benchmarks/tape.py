"""Costs of a tape per launch: time to record, bytes kept, time to go back, checks of regions.

    python benchmarks/tape.py [launches]

Prints a line per program. Times are the processor's: `recorded` for a launch on a tape, `plain` for
the same launch without one. `bytes` is the growth of the process per recorded launch, with the
copies of what was overwritten. `watched` is for a launch that is not recorded while the tape has
records: what it writes is looked up among all that they have read.
"""

from __future__ import annotations

import sys
import time

import warp as wp


@wp.kernel
def advance(x: wp.array2d(dtype=float), k: int):
    i = wp.tid()
    x[k + 1, i] = x[k, i] + 0.001 * x[k, i] * x[k, i]


@wp.kernel
def turn(x: wp.array2d(dtype=float), k: int, rows: int):
    i = wp.tid()
    x[(k + 1) % rows, i] = x[k % rows, i] + 0.001 * x[k % rows, i] * x[k % rows, i]


@wp.kernel
def sweep(x: wp.array2d(dtype=float), k: int):
    i = wp.tid()
    x[0, i] = x[0, i] + 0.001 * x[0, i] * x[0, i]


def programs(count, columns):
    """Name, kernel, number of rows, arguments after the array by number of the launch."""
    yield "trajectory", advance, count + 1, lambda k: [k]
    yield "ring of 8 rows", turn, 8, lambda k: [k, 8]
    yield "in place", sweep, 1, lambda k: [k]


def resident() -> int:
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096


def run(kernel, x, arguments, count, record=True) -> float:
    dim = x.shape[1]
    start = time.process_time()
    for k in range(count):
        wp.launch(kernel, dim, [x, *arguments(k)], device="cpu", record_tape=record)
    return (time.process_time() - start) / count * 1e6


def measure(name, kernel, rows, arguments, count, columns) -> None:
    x = wp.full((rows, columns), 0.5, dtype=float, device="cpu", requires_grad=True)
    run(kernel, x, arguments, min(count, 1000))
    plain = run(kernel, x, arguments, count)
    before = resident()
    with wp.Tape() as tape:
        recorded = run(kernel, x, arguments, count)
    kept = (resident() - before) / count
    start = time.process_time()
    tape.backward(grads={x: wp.ones(x.shape, dtype=float, device="cpu")})
    back = (time.process_time() - start) / count * 1e6
    copies = tape.kept_bytes / count
    other = wp.full(x.shape, 0.5, dtype=float, device="cpu")
    watched = run(kernel, other, arguments, count, record=False)
    print(
        f"{name:16} {count} launches of {columns}: plain {plain:.2f}, recorded {recorded:.2f}, "
        f"backward {back:.2f}, watched {watched:.2f} us; {kept:.0f} bytes, {copies:.0f} of copies"
    )


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    columns = 8
    for program in programs(count, columns):
        measure(*program, count, columns)


if __name__ == "__main__":
    main()
