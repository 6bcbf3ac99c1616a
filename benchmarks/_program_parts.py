"""Parts of random programs: what kernels of users are made of.

A part is a few lines that change the local number `a` of thread `i`, with the arguments that they
read. `N` is the number of threads, `T` the scalar type, `{n}` a number that no other part has.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """A fragment of a kernel.

    Args:
        lines: the statements.
        arguments: (name, annotation, expression that makes the array) of each argument.
        before: statements of the module.
        weight: operations of a thread, roughly.
    """

    lines: str
    arguments: tuple = ()
    before: str = ""
    weight: int = 4


def real(name, extent="N", low=0.0, high=1.0):
    """An argument of numbers with a gradient."""
    made = f"data.real({extent}, T, {low}, {high})"
    return name, "wp.array(dtype=T)", made


def whole(name, extent, low, high):
    """An argument of integers."""
    return name, "wp.array(dtype=int)", f"data.integers({extent}, {low}, {high})"


def stream(pick):
    return Part("a = a * y{n}[i] + T(0.5)", (real("y{n}"),))


def functions(pick):
    what = pick(["wp.sin(a) * wp.exp(-a * a)", "wp.sqrt(a * a + T(1.0))", "wp.atan2(a, T(2.0))"])
    return Part(f"a = {what}", weight=20)


def gather(pick):
    return Part("a = a + z{n}[k{n}[i]]", (real("z{n}"), whole("k{n}", "N", 0, "N")), weight=8)


def shared_list(pick):
    count = pick([3, 16, 64])
    line = "a = a * T(0.5) + w{n}[j] * wp.abs(a - w{n}[j])"
    return Part(f"for j in range({count}):\n    {line}", (real("w{n}", count),), weight=4 * count)


def ragged_row(pick):
    length = pick([2, 8, 40])
    made = f"data.given(np.r_[0, data.random.integers(0, {2 * length}, N).cumsum()], int)"
    return Part(
        "for j in range(b{n}[i], b{n}[i + 1]):\n    a = a + v{n}[c{n}[j] % N]",
        (
            ("b{n}", "wp.array(dtype=int)", made),
            whole("c{n}", f"2 * {length} * N", 0, "N"),
            real("v{n}"),
        ),
        weight=6 * length,
    )


def left_early(pick):
    count = pick([16, 64])
    return Part(
        f"for j in range({count}):\n    a = a + w{{n}}[j] * T(0.25)\n"
        "    if a > T(3.0):\n        break",
        (real("w{n}", count),),
        weight=2 * count,
    )


def branch(pick):
    return Part("if a > T(0.7):\n    a = wp.sqrt(a)\nelse:\n    a = a * a + T(0.1)", weight=8)


def small_matrix(pick):
    size = pick([2, 3, 4, 6])
    vector, matrix = f"V{size}", f"M{size}"
    before = (
        f"{vector} = wp.types.vector({size}, T)\n{matrix} = wp.types.matrix(({size}, {size}), T)"
    )
    return Part(
        "p{n}_ = p{n}[i]\nm{n} = wp.outer(p{n}_, p{n}_) * a\n"
        "a = a + wp.dot(m{n} * p{n}_, p{n}_) / T(10.0)",
        (("p{n}", f"wp.array(dtype={vector})", f"data.real((N, {size}), {vector})"),),
        before,
        weight=4 * size * size,
    )


def record(pick):
    fields = pick([2, 5, 12])
    body = "".join(f"    f{k}: {'wp.vec3' if k % 3 == 2 else 'float'}\n" for k in range(fields))
    terms = [f"wp.length(s{{n}}.f{k})" if k % 3 == 2 else f"s{{n}}.f{k}" for k in range(fields)]
    # Zeros that nobody has written are one page of memory, where the peer has them.
    made = "wp.array(np.ones(N, dtype=S{n}.numpy_dtype()), dtype=S{n}, device=data.device)"
    return Part(
        f"s{{n}} = r{{n}}[i]\na = a + T({' + '.join(terms)})",
        (("r{n}", "wp.array(dtype=S{n})", made),),
        f"@wp.struct\nclass S{{n}}:\n{body}",
        weight=4 * fields,
    )


def table(pick):
    count = pick([9, 27])
    values = ", ".join(f"{0.1 * ((7 * k) % count) + 0.05:.2f}" for k in range(count))
    return Part(
        f"for j in range({count}):\n    a = a + TABLE{{n}}[j] * y{{n}}[(i + j) % N]",
        (real("y{n}"),),
        f"TABLE{{n}} = wp.constant(wp.types.vector({count}, T)({values}))",
        weight=4 * count,
    )


def local_array(pick):
    count = pick([4, 12, 32])
    return Part(
        f"l{{n}} = L{count}()\nfor j in range({count}):\n"
        f"    l{{n}}[j] = a * T(0.1) + y{{n}}[(i + j) % N]\n"
        f"for j in range(1, {count}):\n    a = a + l{{n}}[j] * l{{n}}[j - 1] * T(0.05)",
        (real("y{n}"),),
        f"L{count} = wp.types.vector({count}, T)",
        weight=6 * count,
    )


def stencil(pick):
    return Part(
        "d{n} = y{n}[wp.max(i - 1, 0)] - T(2.0) * y{n}[i] + y{n}[wp.min(i + 1, N_ - 1)]\n"
        "a = a + T(0.3) * d{n}",
        (real("y{n}"),),
        weight=8,
    )


def groups(pick):
    share = pick([4, 16, 32])
    return Part(
        f"for j in range(e{{n}}[i // {share}]):\n    a = a * T(0.9) + y{{n}}[i // {share}]",
        (real("y{n}"), whole("e{n}", "N", 1, 9)),
        weight=10,
    )


def row_sum(pick):
    length = pick([3, 16, 100, 256])
    return Part(
        f"for j in range({length}):\n    a = a + q{{n}}[i, j] * T(0.1)",
        (("q{n}", "wp.array2d(dtype=T)", f"data.real((N, {length}), T)"),),
        weight=2 * length,
    )


def random_numbers(pick):
    return Part("g{n} = wp.rand_init(11, i)\na = a + T(wp.randf(g{n}))", weight=12)


def early_return(pick):
    before = (
        "@wp.func\ndef clipped{n}(a: T) -> T:\n    if a < T(0.2):\n        return T(0.2)\n"
        "    if a > T(5.0):\n        return T(5.0) + wp.log(a)\n    return a"
    )
    return Part("a = clipped{n}(a)", (), before, weight=8)


def recurrence(pick):
    length = pick([4, 30])
    return Part(
        f"o{{n}}[i, 0] = a\nfor j in range({length}):\n"
        "    o{n}[i, j + 1] = o{n}[i, j] * T(0.8) + u{n}[i, j] * T(0.2)\n"
        f"a = o{{n}}[i, {length}]",
        (
            ("u{n}", "wp.array2d(dtype=T)", f"data.real((N, {length}), T)"),
            ("o{n}", "wp.array2d(dtype=T)", f"data.out((N, {length + 1}), T)"),
        ),
        weight=6 * length,
    )


def integers(pick):
    return Part(
        "h{n} = k{n}[i]\nfor j in range(5):\n    h{n} = h{n} ^ (h{n} << 3)\n"
        "    h{n} = h{n} + (h{n} >> 5)\na = a + T(h{n} % 7)",
        (whole("k{n}", "N", 0, 1000),),
        weight=25,
    )


PARTS = (
    *(stream, functions, gather, shared_list, ragged_row, left_early, branch, small_matrix),
    *(record, table, local_array, stencil, groups, row_sum, random_numbers, early_return),
    *(recurrence, integers),
)

# How the number of a thread leaves the kernel: (lines, arguments, number of results).
ENDS = {
    "store": ("out[i] = a", (), "N"),
    "scatter": ("wp.atomic_add(out, t[i], a)", (whole("t", "N", 0, "N"),), "N"),
    "few_sums": ("wp.atomic_add(out, i % 10, a)", (), "10"),
    "sum": ("wp.atomic_add(out, 0, a)", (), "1"),
    "least": ("wp.atomic_min(out, t[i], a)", (whole("t", "N", 0, "(N + 3) // 4"),), "(N + 3) // 4"),
    "strided": ("out[(i * 7) % N_] = a", (), "N"),
}
