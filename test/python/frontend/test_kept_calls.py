"""Large functions with several calls stay functions beyond a kernel's budget."""

import numpy as np
import pytest

import warp as wp
from frontend_programs import define
from warp.extend import errors

BUDGET = {"inline_budget": 64}


@wp.struct
class Body:
    """A struct with an array, a vector and a number."""

    values: wp.array(dtype=float)
    axis: wp.vec3
    count: int


@wp.func
def polynomial(x: float, degree: int):
    """Sum of the powers of x below a degree of at most 24, and the last power."""
    total = float(0.0)
    power = float(1.0)
    for i in range(24):
        if i < degree:
            total += power
            power *= x
    return total, power


@wp.func
def weigh(body: Body, x: float, flip: bool):
    """Sums up the array of a struct, and stores into it."""
    total = wp.vec3(0.0)
    for i in range(body.count):
        if flip:
            total += body.axis * body.values[i] * x
        else:
            total -= body.axis * body.values[i] * x
    part, last = polynomial(x, body.count)
    body.values[0] = body.values[0] + part
    turn = wp.mat33(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    turn = turn * turn * turn * turn * turn
    return turn * total, last


@wp.kernel(module="unique", module_options=BUDGET)
def bodies(
    values: wp.array2d(dtype=float), axis: wp.vec3, y: wp.array(dtype=wp.vec3),
    z: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    body = Body()
    body.values = values[i]
    body.axis = axis
    body.count = values.shape[1]
    a, s = weigh(body, 0.5, True)
    b, t = weigh(body, 0.25, False)
    part, last = polynomial(values[i, 1], 20)
    y[i] = a + b
    z[i] = s + t + part + last


def expected(values, axis):
    """The same in float64; five quarter turns about z are one."""
    values, (x, y, z) = values.astype(np.float64), axis
    count = values.shape[1]
    turned = np.array([-y, x, z])
    vectors = np.zeros((len(values), 3))
    numbers = np.zeros(len(values))
    for factor, sign in ((0.5, 1.0), (0.25, -1.0)):
        vectors += sign * factor * values.sum(axis=1)[:, None] * turned
        values[:, 0] += (1.0 - factor**count) / (1.0 - factor)
        numbers += factor**count
    base = values[:, 1]
    numbers += (1.0 - base**20) / (1.0 - base) + base**20
    return vectors, numbers, values


@pytest.fixture
def rows():
    return np.random.default_rng(3).uniform(-0.9, 0.9, (37, 7)).astype(np.float32)


def launch(kernel, rows, axis=(1.0, 2.0, -0.5)):
    values = wp.array(rows, dtype=float, device="cpu")
    y = wp.zeros(len(rows), dtype=wp.vec3, device="cpu")
    z = wp.zeros(len(rows), dtype=float, device="cpu")
    wp.launch(kernel, len(rows), [values, wp.vec3(*axis), y, z], device="cpu")
    return y.numpy(), z.numpy(), values.numpy()


def test_arguments_and_results(rows):
    """Structs, arrays that are read and written, booleans, vectors and tuples."""
    for found, wanted in zip(launch(bodies, rows), expected(rows, (1.0, 2.0, -0.5)), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=2e-5, atol=1e-5)


def test_functions_stay():
    """The large one is a function of the target, on CPUs for all lanes; the small one is not."""
    for text, name in (
        (bodies.ir("llvm"), "weigh_rows_lanes("),
        (bodies.ir("ptx", arch=90), "weigh("),
    ):
        assert name in text and "polynomial" not in text
    (schedule,) = bodies.schedule("cpu", dim=1000)
    assert int(schedule["lanes"]) > 1


def test_lanes_have_the_bits_of_scalar_threads(rows):
    """Rows, structs, loops and stores in functions that lanes call."""
    options = {**BUDGET, "cpu_lanes": 1}
    scalar = wp.kernel(bodies.func, module="unique", module_options=options)
    (schedule,) = scalar.schedule("cpu", dim=1000)
    assert schedule["lanes"] == "1" and "weigh(" in scalar.ir("llvm")
    for one, many in zip(launch(scalar, rows), launch(bodies, rows), strict=True):
        np.testing.assert_array_equal(one, many)


@wp.func
def steps(n: int, limit: int, table: wp.array(dtype=int)):
    """Collatz steps of n up to 1, of a limit, and the table's numbers on the way."""
    if n < 1:
        return -1, 0
    taken = int(0)
    seen = int(0)
    while n != 1:
        if taken == limit:
            break
        seen += table[n % table.shape[0]]
        if n % 2 == 0:
            n = n // 2
        else:
            n = 3 * n + 1
        taken += 1
    for k in range(n % 5):
        seen += k * limit
    return taken, seen


@wp.func
def steps_of_two(n: int, limit: int, table: wp.array(dtype=int), out: wp.array(dtype=int)):
    """Calls another function that stays, in a branch and after it, and stores."""
    a, s = steps(n, limit, table)
    if n % 3 == 0:
        b, t = steps(n + 1, a + 1, table)
        a += b
        s += t
    if n >= 0:
        out[n] = out[n] + a
    return a, s


@wp.kernel(module="unique", module_options=BUDGET)
def walks(
    n: wp.array(dtype=int), table: wp.array(dtype=int), out: wp.array(dtype=int),
    y: wp.array(dtype=int), z: wp.array(dtype=int),
):  # fmt: skip
    i = wp.tid()
    a, s = steps_of_two(n[i], 40, table, out)
    for k in range(n[i] % 3):
        b, t = steps_of_two(n[i], 10 + k, table, out)
        a += b
        s += t
    b, t = steps(27, 9, table)
    y[i] = a + b
    z[i] = s + t


def walk(n, limit, table):
    if n < 1:
        return -1, 0
    taken = seen = 0
    while n != 1 and taken != limit:
        seen += int(table[n % len(table)])
        n = n // 2 if n % 2 == 0 else 3 * n + 1
        taken += 1
    return taken, seen + sum(range(n % 5)) * limit


def walk_twice(n, limit, table, out):
    a, s = walk(n, limit, table)
    if n % 3 == 0:
        b, t = walk(n + 1, a + 1, table)
        a, s = a + b, s + t
    if n >= 0:
        out[n] += a
    return a, s


@pytest.mark.parametrize("count", [1, 3, 101])
def test_lanes_part_in_functions(count):
    """Early returns, breaks and loops of each lane's own, nested, under masks."""
    numbers = np.random.default_rng(5).permutation(200)[:count] - 3
    table = np.arange(7) ** 2 - 11
    device = {"dtype": int, "device": "cpu"}
    out, y, z = (wp.zeros(size, **device) for size in (200, count, count))
    wp.launch(walks, count, [wp.array(numbers, **device), wp.array(table, **device), out, y, z],
              device="cpu")  # fmt: skip
    total, expect = np.zeros(200, dtype=int), []
    shared = walk(27, 9, table)
    for n in numbers.tolist():
        found = [walk_twice(n, 40, table, total), shared]
        # The remainder of a negative number is negative, so there is no trip.
        found += [walk_twice(n, 10 + k, table, total) for k in range(int(np.fmod(n, 3)))]
        expect.append(np.sum(found, axis=0))
    np.testing.assert_array_equal(y.numpy(), [a for a, _ in expect])
    np.testing.assert_array_equal(z.numpy(), [s for _, s in expect])
    np.testing.assert_array_equal(out.numpy(), total)


def test_functions_of_parting_lanes_are_of_lanes():
    """The test above is about vectors."""
    (schedule,) = walks.schedule("cpu", dim=1000)
    assert int(schedule["lanes"]) > 1 and "steps_of_two_lanes(" in walks.ir("llvm")


@pytest.mark.parametrize("option", ["mode", "deterministic"])
def test_all_calls_are_inlined(option, rows):
    """Debug launches check each access in the kernel, deterministic ones plan all updates of it."""
    value = "debug" if option == "mode" else True
    options = {**BUDGET, option: value}
    kernel = wp.kernel(bodies.func, module="unique", module_options=options)
    assert "weigh(" not in kernel.ir("llvm") and "weigh(" not in kernel.ir("ptx", arch=90)
    for found, wanted in zip(launch(kernel, rows), expected(rows, (1.0, 2.0, -0.5)), strict=True):
        np.testing.assert_allclose(found, wanted, rtol=2e-5, atol=1e-5)


def test_budget():
    """None is the target's own, within which this kernel is."""
    kernel = wp.kernel(bodies.func, module="unique", module_options={"inline_budget": None})
    assert "weigh" not in kernel.ir("llvm") and "weigh" not in kernel.ir("ptx", arch=90)


STEP = "    x = wp.sin(x) * 0.75 + wp.cos(x * 0.5)\n"
PROGRAM = f"""
@wp.func
def inner(x: float):
{16 * STEP}    return x
"""
PROGRAM += """

@wp.func
def outer(x: float, y: wp.array(dtype=float), i: int):
    {line}
    return inner(x) + inner(x * 0.5)

@wp.kernel(module="unique", module_options={{"inline_budget": 64}})
def kernel(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = outer(x[i], y, i) - outer(x[i] + 1.0, y, i)
"""


def inner(x):
    for _ in range(16):
        x = np.sin(x) * 0.75 + np.cos(x * 0.5)
    return x


def outer(x):
    return inner(x) + inner(x * 0.5)


def test_derivatives():
    """Derivatives are those of the inlined program: against central differences in float64."""
    kernel = define(PROGRAM.format(line="pass"))["kernel"]
    points = np.linspace(-1.0, 1.0, 9)
    x = wp.array(points, dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(9, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, 9, [x, y], device="cpu")
    tape.backward(grads={y: wp.ones(9, dtype=float, device="cpu")})

    def f(x):
        return outer(x) - outer(x + 1.0)

    step = 1e-6
    slope = (f(points + step) - f(points - step)) / (2.0 * step)
    np.testing.assert_allclose(y.numpy(), f(points), atol=2e-6)
    np.testing.assert_allclose(x.grad.numpy(), slope, rtol=1e-4, atol=1e-6)


def test_updates_are_made_by_the_kernel():
    """A function with an atomic update is inlined, and updates count once for each thread."""
    kernel = define(PROGRAM.format(line="wp.atomic_add(y, 0, 1.0)"))["kernel"]
    text = kernel.ir("llvm")
    assert "@outer" not in text and "@inner" in text
    x = wp.zeros(1000, dtype=float, device="cpu")
    y = wp.zeros(1001, dtype=float, device="cpu")
    counting = define(
        PROGRAM.format(line="wp.atomic_add(y, 1000, 1.0)").replace("y[i] = ", "value = ")
    )["kernel"]
    wp.launch(counting, 1000, [x, y], device="cpu")
    assert y.numpy()[1000] == 2000.0


def test_error_in_a_function_that_stays():
    """The place is that of the user's line."""
    kernel = define(PROGRAM.format(line="x = x + missing"))["kernel"]
    x = wp.zeros(1, dtype=float, device="cpu")
    with pytest.raises(errors.WarpError) as caught:
        wp.launch(kernel, 1, [x, x], device="cpu")
    message = str(caught.value)
    assert ">:25:13" in message and "x = x + missing" in message and "^" in message


def test_recursion_through_arguments():
    """Functions that call each other by way of an argument are named in a clear error."""
    source = """
@wp.func
def first(f: wp.Function, g: wp.Function, x: float):
    return g(g, f, x)

@wp.kernel
def kernel(y: wp.array(dtype=float)):
    y[0] = first(first, first, 1.0)
"""
    y = wp.zeros(1, dtype=float, device="cpu")
    with pytest.raises(errors.WarpError, match=r"recursion is not supported.*first -> first"):
        wp.launch(define(source)["kernel"], 1, [y], device="cpu")


def test_recursion_through_two_functions():
    """Each calls the other by way of one that calls its argument; the chain is named."""
    source = """
@wp.func
def apply(f: wp.Function, x: float) -> float:
    return f(x)

@wp.func
def even(x: float) -> float:
    return apply(odd, x - 1.0)

@wp.func
def odd(x: float) -> float:
    return apply(even, x - 1.0)

@wp.kernel
def kernel(y: wp.array(dtype=float)):
    y[0] = even(y[0])
"""
    y = wp.zeros(1, dtype=float, device="cpu")
    chain = "even -> apply -> odd -> apply -> even"
    with pytest.raises(errors.WarpError, match=f"recursion is not supported.*{chain}"):
        wp.launch(define(source)["kernel"], 1, [y], device="cpu")


def test_recursion_through_types():
    """Calls of a function for other types within itself that never end are an error, too."""
    source = """
@wp.func
def grow(t: Any):
    return grow((t, 1.0))

@wp.kernel
def kernel(y: wp.array(dtype=float)):
    x = grow(y[0])
"""
    y = wp.zeros(1, dtype=float, device="cpu")
    with pytest.raises(errors.WarpError, match="recursion is not supported.*grow -> grow"):
        wp.launch(define("from typing import Any\n" + source)["kernel"], 1, [y], device="cpu")


def test_functions_for_other_arguments_are_others():
    """One that calls its argument may be called below that, for another function or type."""
    source = """
@wp.func
def apply(f: wp.Function, x: Any):
    return f(x)

@wp.func
def negate(x: Any):
    return -x

@wp.func
def half_below(x: Any):
    return apply(negate, 0.5 * float(x))

@wp.func
def plus_one(x: float):
    return apply(half_below, x) + 1.0

@wp.kernel
def kernel(y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = apply(plus_one, y[i]) + apply(half_below, i)
"""
    y = wp.full(4, 3.0, dtype=float, device="cpu")
    wp.launch(define("from typing import Any\n" + source)["kernel"], 4, [y], device="cpu")
    assert y.numpy().tolist() == [-0.5 - 0.5 * i for i in range(4)]


def test_many_functions():
    """Code follows the text: each of 60 functions calls the two before it."""
    count = 60
    step = "    return 0.5 * f{0}(x) + 0.25 * f{1}(x * 0.5) + {2}"
    lines = [
        "@wp.func\ndef f0(x: float):\n    return x",
        "@wp.func\ndef f1(x: float):\n    return -x",
    ]
    lines += [
        f"@wp.func\ndef f{i}(x: float):\n" + step.format(i - 1, i - 2, i / count)
        for i in range(2, count)
    ]
    kernel = "@wp.kernel\ndef kernel(y: wp.array(dtype=float)):\n    y[wp.tid()] = f12(2.0)\n"
    kernel = define("\n".join(lines) + "\n" + kernel.replace("f12", f"f{count - 1}"))["kernel"]
    assert len(kernel.ir("ptx", arch=90).splitlines()) < 100 * count


def test_large_function():
    """Results of more numbers than any register file holds come back in memory."""
    source = """
Big = wp.types.matrix((20, 20), float)

@wp.func
def big(m: Big, x: float):
    return m * x + m, x

@wp.kernel(module_options={"inline_budget": 64})
def kernel(y: wp.array(dtype=float)):
    i = wp.tid()
    m, a = big(Big(1.0), 1.0)
    n, b = big(m, float(i))
    total = float(0.0)
    for j in range(20):
        for k in range(20):
            total += n[j, k]
    y[i] = total + a + b
"""
    kernel = define(source)["kernel"]
    y = wp.zeros(5, dtype=float, device="cpu")
    wp.launch(kernel, 5, [y], device="cpu")
    expected = [800.0 * (i + 1.0) + 1.0 + i for i in range(5)]
    assert y.numpy().tolist() == expected
    assert "big(" in kernel.ir("llvm") and "big(" in kernel.ir("ptx", arch=90)


def test_ten_thousand_functions():
    """A kernel that calls 100 functions of which each calls 100 others of its own."""
    lines = [
        f"@wp.func\ndef leaf{n}(x: float):\n    return x * {n % 7}.0 + {n % 3}.0\n"
        for n in range(10_000)
    ]
    for m in range(100):
        terms = "".join(f"    s += leaf{n}(x)\n" for n in range(100 * m, 100 * m + 100))
        lines.append(f"@wp.func\ndef sum{m}(x: float):\n    s = float(0.0)\n{terms}    return s\n")
    terms = "".join(f"    s += sum{m}(x[i])\n" for m in range(100))
    lines.append(
        "@wp.kernel\ndef kernel(x: wp.array(dtype=float)):\n    i = wp.tid()\n"
        f"    s = float(0.0)\n{terms}    x[i] = s\n"
    )
    x = wp.array([1.0, 2.0], dtype=float, device="cpu")
    wp.launch(define("\n".join(lines))["kernel"], 2, [x], device="cpu")
    slope, offset = sum(n % 7 for n in range(10_000)), sum(n % 3 for n in range(10_000))
    assert x.numpy().tolist() == [slope + offset, 2 * slope + offset]


def test_ten_thousand_levels():
    """A chain that is deeper than Python's stack is an error that names the kernel's line."""
    lines = ["@wp.func\ndef f0(x: float):\n    return x\n"]
    lines += [
        f"@wp.func\ndef f{n}(x: float):\n    return f{n - 1}(x) + 1.0\n" for n in range(1, 10_000)
    ]
    lines.append("@wp.kernel\ndef kernel(x: wp.array(dtype=float)):\n    x[0] = f9999(x[0])\n")
    x = wp.zeros(1, dtype=float, device="cpu")
    with pytest.raises(errors.WarpError, match=r"(?s)nested too deeply.*x\[0\] = f9999.*hint: "):
        wp.launch(define("\n".join(lines))["kernel"], 1, [x], device="cpu")
