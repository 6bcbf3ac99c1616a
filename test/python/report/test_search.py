"""The generated search: it finds planted defects, and what it once found stays mended."""

import json
import subprocess
import sys

import numpy as np
import pytest

import warp as wp
from warp.report.__main__ import main

mp = pytest.importorskip("mpmath")

from warp.report.search import (  # noqa: E402
    FORMULAS,
    SPECIAL,
    STRATEGIES,
    overloads,
    search,
    without_reference,
)

# Operands at singular points.
SINGULAR = {SPECIAL: STRATEGIES[SPECIAL]}


@pytest.mark.parametrize(
    ("name", "rows"),
    [("sin", 4), ("hypot", 4), ("dot", 4), ("normalize", 4), ("quat_log", 4), ("logsumexp", 8)]
    + [("inverse", 1), ("solve3", 2), ("sym_sqrt3", 1), ("transform_point", 2), ("log1p", 4)]
    + [("svd2", 2), ("svd3", 2), ("eig3", 2), ("qr3", 2)]
    + [("quat_twist", 4), ("quat_to_axis_angle", 4), ("transform_decompose", 4)],
)
def test_builtins_keep_a_digit(name, rows):
    found = list(search([name], rows=rows, seed=3))
    assert len(found) == 4 * len(list(overloads([name]))) and all(one.checked for one in found)
    assert [str(one) for one in found if one.verdict == "defect"] == []


# 1 - cos(x) by subtraction has no digit for small x, though the problem is a harmless one.
def test_cancellation_is_a_defect(monkeypatch):
    def naive(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = 1.0 - wp.cos(x[i])

    monkeypatch.setitem(FORMULAS, "sin", lambda x: 2 * mp.sin(x / 2) ** 2)
    make = lambda *about: wp.kernel(naive)  # noqa: E731
    value, gradient = search(["sin"], dtypes=("float32",), rows=16, make=make)
    assert value.verdict == "defect" and value.got == 0.0 and 0.0 < value.exact < 1e-7
    assert value.operands[0] ** 2 / 2 == pytest.approx(value.exact, rel=1e-3)
    assert gradient.verdict == "good"


# The derivative of (1 - cos(x)) / x at 0 is 1/2, not that of the constant that stands for 0/0.
def test_limits_at_singular_points(monkeypatch):
    def guarded(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        if x[i] == wp.float64(0.0):
            y[i] = wp.float64(0.0)
        else:
            y[i] = (wp.float64(1.0) - wp.cos(x[i])) / x[i]

    monkeypatch.setitem(FORMULAS, "sin", lambda x: 2 * mp.sin(x / 2) ** 2 / x)
    value, gradient = search(
        ["sin"],
        dtypes=("float64",),
        rows=16,
        make=lambda *about: wp.kernel(guarded),
        strategies=SINGULAR,
    )
    assert value.verdict == "good" and value.checked
    assert gradient.verdict == "defect" and (gradient.got, gradient.operands) == (0.0, [0.0])
    assert gradient.exact == pytest.approx(0.5)


# Paths that do not agree are no reference: the length has no derivative at zero.
def test_no_limit_at_a_kink():
    names = ["length", "normalize", "abs", "max"]
    found = list(search(names, dtypes=("float64",), rows=8, strategies=SINGULAR))
    assert [str(one) for one in found if one.verdict != "good"] == []


# The difference of nearly equal numbers is as wrong as its operands are.
def test_condition_is_no_defect():
    found = list(search(["cross"], dtypes=("float32",), rows=32))
    assert {one.verdict for one in found} <= {"good", "condition"}
    worst = found[0]
    assert worst.verdict == "good" or worst.condition > 1e5


def test_command(tmp_path, capsys, monkeypatch):
    assert main(["search", "cbrt", "--rows", "2", "--all", "--output", str(tmp_path)]) == 0
    assert "good      gradient float64 cbrt(x: F) -> F" in capsys.readouterr().out
    lines = [json.loads(one) for one in (tmp_path / "search.jsonl").read_text().splitlines()]
    assert [one.get("part") for one in lines] == [None] + ["value", "gradient"] * 2
    assert main(["search", "no_such", "--output", str(tmp_path)]) == 2
    assert "no reference for 'no_such'" in capsys.readouterr().err
    assert "stop_gradient" in without_reference() and not set(without_reference()) & set(FORMULAS)
    program = "import sys\nsys.modules['mpmath'] = None\nfrom warp.report.__main__ import main\n"
    program += f"sys.exit(main(['search', 'cbrt', '--output', {str(tmp_path)!r}]))\n"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.returncode == 2 and "needs the package 'mpmath'" in done.stderr


def test_interrupted_and_full_disk_keep_what_was_found(tmp_path, capsys, monkeypatch):
    def interrupted(names, **options):
        yield from search(names, dtypes=("float32",), rows=2)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("warp.report.search.search", interrupted)
        assert main(["search", "cbrt", "--output", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "interrupted" in said.err and "2 good" in said.out
    assert len((tmp_path / "search.jsonl").read_text().splitlines()) == 3
    (tmp_path / "search.jsonl").unlink()
    (tmp_path / "search.jsonl").symlink_to("/dev/full")
    assert main(["search", "cbrt", "--rows", "2", "--output", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "No space left" in said.err and "4 good" in said.out


# Processes divide the overloads; what they find, and its order, is the same.
def test_processes_find_the_same():
    names = ["dot", "quat_log", "hypot"]
    assert list(search(names, rows=2)) == list(search(names, rows=2, processes=2))
    with pytest.raises(ValueError, match="greater than 0"):
        list(search(names, processes=0))


# Equal largest terms share the gradient; the first had none.
def test_logsumexp_of_equal_numbers(device):
    @wp.kernel
    def sums(x: wp.array(dtype=wp.vec3), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = wp.logsumexp(x[i])

    given = np.array([(1, 1, 1), (2, -5, 2), (-3, 4, 4)], np.float32)
    x = wp.array(given, dtype=wp.vec3, requires_grad=True, device=device)
    y = wp.zeros(3, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(sums, 3, [x, y], device=device)
    tape.backward(grads={y: wp.ones(3, dtype=float, device=device)})
    weights = np.exp(given - given.max(1, keepdims=True))
    np.testing.assert_allclose(x.grad.numpy(), weights / weights.sum(1, keepdims=True), rtol=1e-6)


# The solution of a subnormal system times the scale of its matrix overflowed.
def test_solutions_of_subnormal_systems(device):
    @wp.kernel
    def solves(a: wp.array(dtype=wp.mat33), b: wp.array(dtype=wp.vec3), x: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        x[i] = wp.solve3(a[i], b[i])

    system = np.array([[4, 1, 0], [1, 3, -1], [0, -1, 2]]) * 2.0**-140
    side = np.array([900, -700, 300]) * 2.0**-140
    a = wp.array(system[None], dtype=wp.mat33, device=device)
    b = wp.array(side[None], dtype=wp.vec3, device=device)
    x = wp.zeros(1, dtype=wp.vec3, device=device)
    wp.launch(solves, 1, [a, b, x], device=device)
    exact = np.linalg.solve(system * 2.0**140, side * 2.0**140)
    np.testing.assert_allclose(x.numpy()[0], exact, rtol=1e-5)


def test_slopes_of_smoothstep_near_its_ends(device):
    """1 - t, which the slope has, is (b - x) / (b - a): nothing cancels."""

    @wp.kernel(module="unique")
    def step(p: wp.array(dtype=float), y: wp.array(dtype=float)):
        y[0] = wp.smoothstep(p[0], p[1], p[2])

    for numbers in [(-62738.15234375, 5.706975e-08, -0.00065643096), (1e-8, 3e4, 2e-4)]:
        p = wp.array(numbers, dtype=float, device=device, requires_grad=True)
        y = wp.zeros(1, dtype=float, device=device, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(step, 1, [p, y], device=device)
        tape.backward(y)
        a, b, x = p.numpy().astype(np.float64)
        t, rest, width = (x - a) / (b - a), (b - x) / (b - a), b - a
        slope = 6.0 * t * rest / width
        expected = [-slope * rest, -slope * t, slope]
        np.testing.assert_allclose(p.grad.numpy(), expected, rtol=1e-5)


def test_slopes_of_factors_of_nearly_parallel_columns(device):
    """Rounded factors are off by the matrix's condition; what is divided by one, by its square."""

    @wp.kernel(module="unique")
    def weighed(a: wp.array(dtype=wp.mat33), s: wp.array(dtype=wp.mat33), y: wp.array(dtype=float)):
        q, r = wp.qr3(a[0])
        y[0] = wp.ddot(q, s[0]) + wp.ddot(r, s[1])

    given = [
        [-0.029152166098356247, 0.04395010322332382, -0.047295939177274704],
        [-0.004345396533608437, 0.006550004705786705, -0.007049208972603083],
        [0.004808207042515278, -0.007251665461808443, 0.007802648935467005],
    ]
    seeds = np.random.default_rng(5).normal(size=(2, 3, 3)).astype(np.float32)
    a = wp.array([given], dtype=wp.mat33, requires_grad=True, device=device)
    s = wp.array(seeds, dtype=wp.mat33, device=device)
    y = wp.zeros(1, dtype=float, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(weighed, 1, [a, s, y], device=device)
    tape.backward(y)

    def exact(matrix):
        q, r = FORMULAS["qr3"](matrix)
        places = np.ndindex(2, 3, 3)
        return mp.fsum((q, r)[k][i][j] * mp.mpf(float(seeds[k, i, j])) for k, i, j in places)

    with mp.workdps(60):
        matrix = [[mp.mpf(float(x)) for x in row] for row in a.numpy()[0]]
        step, slopes = mp.mpf(10) ** -25, np.zeros((3, 3))
        for i, j in np.ndindex(3, 3):
            ends = []
            for side in (step, -step):
                moved = [list(row) for row in matrix]
                moved[i][j] += side
                ends.append(exact(moved))
            slopes[i, j] = (ends[0] - ends[1]) / (2 * step)
    np.testing.assert_allclose(a.grad.numpy()[0], slopes, rtol=1e-5)
