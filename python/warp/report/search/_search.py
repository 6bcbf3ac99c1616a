"""Runs builtins and their adjoints over operands."""

import functools
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import mpmath as mp
import numpy as np

import warp as wp
from warp import extend
from warp.report.search._judge import FORMULAS, UNIT, Exact, Finding, Judge, NoReferenceError
from warp.report.search._limits import limit_of, with_limits
from warp.report.search._numbers import parse_signature
from warp.report.search._operands import LONG, SPECIAL, STRATEGIES, operands

#: Overloads that the registry describes as of any type, or of which a part alone is unique.
SIGNATURES = {
    "svd2": ("(A: mat<2, 2, F>) -> vec<2, F>",),
    "svd3": ("(A: mat<3, 3, F>) -> vec<3, F>",),
    "eig3": ("(A: mat<3, 3, F>) -> vec<3, F>",),
    "spatial_dot": ("(a: vec<6, F>, b: vec<6, F>) -> F",),
    "spatial_cross": ("(a: vec<6, F>, b: vec<6, F>) -> vec<6, F>",),
    "spatial_cross_dual": ("(a: vec<6, F>, b: vec<6, F>) -> vec<6, F>",),
    "quat_from_matrix": ("(q: quat<F>) -> quat<F>",),
    "transform_from_matrix": ("(p: vec<3, F>, q: quat<F>) -> transform<F>",),
    "transform_decompose": (
        "(p: vec<3, F>, q: quat<F>, s: vec<3, F>) -> (vec<3, F>, quat<F>, vec<3, F>)",
    ),
}
#: Builtins of rotation matrices, which random numbers do not make.
THROUGH = {
    "quat_from_matrix": "function(wp.quat_to_matrix(x0[i]))",
    "transform_from_matrix": "function(wp.transform_to_matrix(wp.transformation(x0[i], x1[i])))",
    "transform_decompose": "function(wp.transform_compose(x0[i], x1[i], x2[i]))",
}
#: Results of which one is unique, by how they are taken apart.
PARTS = {"svd2": "_u, value0, _v", "svd3": "_u, value0, _v", "eig3": "_q, value0"}
DIGITS = 120


def overloads(names=()):
    """(name, signature, parsed) of every overload with a reference; all, or of these builtins."""
    for name in names or FORMULAS:
        group = SIGNATURES.get(name) or getattr(wp, name).signatures
        for signature in group:
            parsed = parse_signature(signature)
            if parsed:
                yield name, signature, parsed


def without_reference():
    """Builtins of floats in the registry that the search has no formula for."""
    builtins = {name: getattr(wp, name) for name in dir(wp) if name not in FORMULAS}
    return sorted(
        name
        for name, found in builtins.items()
        # Other objects have any attribute that is asked for.
        if isinstance(found, type(wp.sin)) and any(map(parse_signature, found.signatures))
    )


@functools.cache
def make_kernel(name, kinds, results, real):
    """A kernel that stores the results of the builtin for one row of operands."""
    types, outs = [kind.of(real) for kind in kinds], [kind.of(real) for kind in results]
    arguments = [f"x{i}: wp.array(dtype=types[{i}])" for i in range(len(types))]
    arguments += [f"y{i}: wp.array(dtype=outs[{i}])" for i in range(len(outs))]
    call = f"function({', '.join(f'x{i}[i]' for i in range(len(types)))})"
    if name in THROUGH:
        call = THROUGH[name]
    values = PARTS.get(name) or ", ".join(f"value{i}" for i in range(len(outs)))
    stores = "".join(f"    y{i}[i] = value{i}\n" for i in range(len(outs)))
    scope = {"wp": wp, "types": types, "function": getattr(wp, name), "outs": outs}
    text = (
        f"def search_{name}({', '.join(arguments)}):\n"
        f"    i = wp.tid()\n    {values} = {call}\n{stores}"
    )
    return wp.kernel(extend.function_from_text(text, scope, module=__name__))


def run(kernel, kinds, results, dtype, values, seeds, device):
    """Results of all rows, and gradients of the seeds' weighted sums by each operand."""
    real, rows = getattr(wp, dtype), len(seeds)

    def array(numbers, kind, **options):
        shaped = numbers.reshape(rows, *kind.shape)
        return wp.array(shaped, dtype=kind.of(real), device=device, **options)

    arrays = [array(x, kind, requires_grad=True) for x, kind in zip(values, kinds, strict=True)]
    outs = [
        wp.zeros(rows, dtype=kind.of(real), device=device, requires_grad=True) for kind in results
    ]
    with wp.Tape() as tape:
        wp.launch(kernel, rows, arrays, outs, device=device)
    ends = np.cumsum([kind.size for kind in results])[:-1]
    parts = zip(outs, np.split(seeds, ends, axis=1), results, strict=True)
    tape.backward(grads={out: array(part, kind) for out, part, kind in parts})
    gradients = [array.grad.numpy().reshape(rows, -1) for array in arrays]
    found = [out.numpy().reshape(rows, -1) for out in outs]
    return np.concatenate(found, axis=1), np.concatenate(gradients, axis=1)


def _tangents(kinds, values, gradients):
    """Gradients without their parts along quaternions."""
    found, at = gradients.astype(np.float64), 0
    for kind, value in zip(kinds, values, strict=True):
        if kind.kind == "quat":
            q, part = value.astype(np.float64), found[:, at : at + 4]
            along = (part * q).sum(1, keepdims=True) / (q * q).sum(1, keepdims=True)
            found[:, at : at + 4] = part - along * q
        at += kind.size
    return found


def _with_reference(exact, values):
    """Rows of operands at which a function has a result, as arrays and as mpmath's numbers."""
    rows, numbers = [], []
    for row in range(len(values[0])):
        these = [mp.mpf(float(x)) for given in values for x in given[row]]
        try:
            if exact(these) is None:
                continue
        except NoReferenceError:
            continue
        rows.append(row)
        numbers.append(these)
    return [value[rows] for value in values], numbers


def search_overload(
    name, signature, parsed, dtype, rows, seed, device, make=make_kernel, strategies=None
):
    """Findings of values and of gradients."""
    _, kinds, results = parsed
    count = sum(result.size for result in results)
    random = np.random.default_rng(seed)
    value = Finding(name, signature, dtype, "value")
    slope = Finding(name, signature, dtype, "gradient")
    judges = Judge(value, random), Judge(slope, random)
    exact, sizes = Exact(name, kinds), [kind.size for kind in kinds]
    parts = [result.size for result in results]
    kernel = make(name, tuple(kinds), tuple(results), getattr(wp, dtype))
    for strategy, values in operands(random, rows, kinds, dtype, strategies or STRATEGIES):
        if name in UNIT and strategy == LONG:
            continue
        is_special = strategy == SPECIAL
        of_values = with_limits(exact, sum(sizes), random) if is_special else exact
        with mp.workdps(DIGITS):
            values, numbers = _with_reference(of_values, values)
            if not numbers:
                continue
            seeds = random.choice([-1.0, 0.5, 1.0], size=(len(numbers), count)).astype(dtype)
            found, gradients = run(kernel, kinds, results, dtype, values, seeds, device)
            if name in UNIT:
                gradients = _tangents(kinds, values, gradients)
            for row, these in enumerate(numbers):
                weights = [mp.mpf(float(x)) for x in seeds[row]]
                gradient = functools.partial(exact.gradient, seed=weights)
                if is_special:
                    gradient = limit_of(gradient, sum(sizes), random)
                judges[0].row(exact, of_values, parts, these, found[row], strategy)
                judges[1].row(exact, gradient, sizes, these, gradients[row], strategy)
    return value, slope


def _finish(task):
    """Findings of one task, in a process of the pool."""
    wp.config.quiet = True
    return search_overload(*task)


def search(
    names=(),
    *,
    dtypes=("float32", "float64"),
    rows=32,
    seed=0,
    device="cpu",
    processes=1,
    make=make_kernel,
    strategies=None,
):
    """Findings for every overload with a reference, of all builtins or of some.

    Args:
        names: of builtins.
        dtypes: precisions to try.
        rows: operands of each strategy.
        seed: of the random numbers.
        device: where kernels run.
        processes: how many overloads are searched at once; the findings and their order are the
            same.
        make: `make(name, kinds, results, scalar)` gives the kernel that stores results of rows.
        strategies: kinds of operands, by name; by default `STRATEGIES`.

    Raises:
        ValueError: a name has no reference.
    """
    unknown = [name for name in names if name not in FORMULAS]
    if unknown:
        known = ", ".join(sorted(FORMULAS))
        raise ValueError(f"no reference for '{unknown[0]}'; there are {known}")
    tasks = [
        (name, signature, parsed, dtype, rows, seed, device, make, strategies)
        for name, signature, parsed in overloads(names)
        for dtype in dtypes
    ]
    if processes == 1:
        for task in tasks:
            yield from search_overload(*task)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=context) as pool:
        for found in pool.map(_finish, tasks):
            yield from found
