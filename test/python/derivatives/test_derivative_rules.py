"""Each overload of each builtin with a derivative: adjoints and tangents against differences.

The cases come from the registry, so a new builtin is tested as soon as it has a record.
"""

import numpy as np
import pytest
from warp._src.builtin_table import BUILTINS, DERIVATIVES

import warp as wp
from derivative_values import COUNT, Overload


def positive_definite(values):
    m = values.reshape(COUNT, 3, 3)
    return (m @ m.transpose(0, 2, 1) + np.eye(3)).reshape(COUNT, 9)


# Functions that are defined on symmetric matrices without negative eigenvalues.
OPERANDS = {"sym_sqrt3": positive_definite, "sym_log3": positive_definite}
# Its operands belong together; test_derivatives_decompositions has it as part of `sym_fn3`.
# Functions whose derivative is a builtin that has none.
ONCE = ("noise_gradient", "pnoise_gradient")
SMOOTH = [
    name
    for name, derivative in DERIVATIVES.items()
    if derivative == "differentiable" and name != "sym_spectral3"
]


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", True)


def check(name, index, device):
    overload = Overload(name, index, OPERANDS.get(name))
    if not overload.is_smooth:
        return
    random = np.random.default_rng(index + 1)
    rows = overload.sample(random)
    matrix, believed = overload.differences(rows, device)
    weights = random.uniform(-1, 1, (COUNT, matrix.shape[1]))
    direction = random.uniform(-1, 1, rows.shape)
    adjoint = overload.adjoint(rows, weights, device)
    tangent = overload.tangent(rows, direction, device)

    text = f"{name}{BUILTINS[name][2][index]}"
    assert believed.sum() >= COUNT * 3 // 4, text
    scale = 1 + np.abs(matrix).max(axis=(1, 2))[:, None]

    def compare(found, expected):
        found, expected = (found / scale)[believed], (expected / scale)[believed]
        np.testing.assert_allclose(found, expected, 0, overload.tolerance, err_msg=text)

    compare(adjoint, np.einsum("nm,nmd->nd", weights, matrix))
    compare(tangent, np.einsum("nmd,nd->nm", matrix, direction))

    if name in ONCE:
        return
    # Tangents of the adjoint.
    second = overload.second(rows, weights, direction, device)
    expected, believed = overload.second_differences(rows, weights, direction, device)
    assert believed.sum() >= COUNT // 2, text
    scale = 1 + np.abs(expected).max(axis=1)[:, None]
    compare(second, expected)
    # <J v, w> = <v, J^T w>, which differences have no part in.
    left, right = (tangent * weights).sum(axis=1), (direction * adjoint).sum(axis=1)
    size = np.linalg.norm(tangent, axis=1) * np.linalg.norm(weights, axis=1)
    size += np.linalg.norm(direction, axis=1) * np.linalg.norm(adjoint, axis=1)
    assert np.all(np.abs(left - right) <= 64 * overload.rounding * (1 + size)), text


@pytest.mark.parametrize("name", SMOOTH)
def test_rule(device, name):
    for index in range(len(BUILTINS[name][2])):
        check(name, index, device)
