"""Essential boundary conditions - projectors of fixed degrees of freedom, projected systems.

A projector P is a block-diagonal matrix: P x are the fixed parts of x. With fixed values u,
the projected system is (1 - P) A (1 - P) + P, (1 - P) (b - A P u) + P u.
"""

import functools

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.forms.integrand import integrand
from warp._src.fem.linalg import array_axpy, generalized_inner, symmetric_eigenvalues_qr
from warp._src.fem.operators import normal
from warp._src.fem.types import Domain, Field, Ints, Sample
from warp.sparse import bsr_assign, bsr_axpy, bsr_block_index, bsr_copy, bsr_mm, bsr_mv

# Directions that are fixed at all count as fixed: smaller eigenvalues, relative to a block's trace,
# are rounding.
_ROUNDING = wp.constant(1.0e-6)


@functools.cache
def _normalize_kernel(scalar, size):
    block = wp.types.matrix(shape=(size, size), dtype=scalar)
    vector = wp.types.vector(length=size, dtype=scalar)

    def normalize(
        offsets: Ints,
        columns: Ints,
        counts: Ints,
        blocks: wp.array(dtype=block),
        values: wp.array(dtype=vector),
        has_values: int,
    ):
        row = wp.tid()
        at = bsr_block_index(row, row, offsets, columns, counts)
        if at >= 0:
            A = blocks[at]
            value = vector()
            if has_values != 0:
                value = values[row]
            least = wp.trace(A) * scalar(_ROUNDING)
            modes, vectors = symmetric_eigenvalues_qr(A, scalar(0.0))
            P, u = block(), vector()
            for k in range(size):
                if modes[k] > least:
                    v = vectors[k]
                    P += wp.outer(v, v)
                    u += wp.dot(v, value) / modes[k] * v
            blocks[at] = P
            if has_values != 0:
                values[row] = u

    return wp.kernel(normalize, enable_backward=False)


@functools.cache
def _adjoint_kernel(scalar, size):
    """The adjoint of a normalization. With B the inverse of a block A on its range, P = A B and
    u = B f: dB = -B dA B + B B dA (1 - P) + (1 - P) dA B B, where the rank does not change."""
    block = wp.types.matrix(shape=(size, size), dtype=scalar)
    vector = wp.types.vector(length=size, dtype=scalar)

    def adjoint(
        offsets: Ints,
        columns: Ints,
        counts: Ints,
        blocks: wp.array(dtype=block),
        values: wp.array(dtype=vector),
        block_grads: wp.array(dtype=block),
        value_grads: wp.array(dtype=vector),
    ):
        row = wp.tid()
        at = bsr_block_index(row, row, offsets, columns, counts)
        if at >= 0:
            A = blocks[at]
            least = wp.trace(A) * scalar(_ROUNDING)
            modes, vectors = symmetric_eigenvalues_qr(A, scalar(0.0))
            B, Q = block(), wp.identity(n=size, dtype=scalar)
            for k in range(size):
                if modes[k] > least:
                    along = wp.outer(vectors[k], vectors[k])
                    B += along / modes[k]
                    Q -= along
            f, g, G = vector(), vector(), block()
            if value_grads.shape[0] > 0:
                f, g = values[row], value_grads[row]
                value_grads[row] = B * g
            if block_grads.shape[0] > 0:
                G = block_grads[at]
                found = Q * G * B + B * G * Q - wp.outer(B * g, B * f)
                found += wp.outer(B * (B * g), Q * f) + wp.outer(Q * g, B * (B * f))
                block_grads[at] = found

    return wp.kernel(adjoint, enable_backward=False)


def _check_projector(projector) -> None:
    rows, cols = projector.block_shape
    if projector.nrow != projector.ncol or rows != cols:
        raise ValueError(
            "'projector_matrix' expects a square matrix of square blocks, but got "
            f"{projector.nrow} x {projector.ncol} blocks of shape {rows} x {cols}"
        )


def _as_vectors(values, scalar, size, count):
    """Fixed values as one vector per row of blocks."""
    if values.size * extend.type_size(values.dtype) != count * size:
        raise ValueError(
            f"'fixed_value' expects {count} elements of {size} numbers, but got "
            f"{values.size} of {extend.type_size(values.dtype)}"
        )
    flat = values.view(extend.type_scalar_type(values.dtype)).flatten()
    return flat.reshape((count, size)).view(wp.types.vector(length=size, dtype=scalar)).flatten()


def normalize_dirichlet_projector(projector_matrix, fixed_value=None) -> None:
    """Scales a projector so that P P = P, and its fixed values alike.

    Args:
        projector_matrix: symmetric positive semi-definite blocks of a diagonal, such as a mass
            matrix of the boundary by nodes.
        fixed_value: in: the integral of the values, by the same form; out: the values.

    Raises:
        ValueError: shapes do not fit.
    """
    P = projector_matrix
    _check_projector(P)
    size, scalar = P.block_shape[0], P.scalar_type
    block = wp.types.matrix(shape=(size, size), dtype=scalar)
    blocks = P.scalar_values.view(block).flatten() if size > 1 else _one_by_one(P, block)
    values = wp.empty(0, dtype=wp.types.vector(length=size, dtype=scalar), device=P.device)
    if fixed_value is not None:
        if extend.is_recording() and P.values.requires_grad:
            fixed_value.requires_grad = True
        values = _as_vectors(fixed_value, scalar, size, P.nrow)
    rows = [P.offsets, P.columns, P._counts()]
    records = extend.is_recording() and (blocks.requires_grad or values.requires_grad)
    with extend.unrecorded():
        before = [wp.clone(x, requires_grad=False) for x in (blocks, values)] if records else None
        inputs = [*rows, blocks, values, int(fixed_value is not None)]
        wp.launch(_normalize_kernel(scalar, size), P.nrow, inputs, device=P.device)

    def backward():
        grads = [x.grad if x.requires_grad else x[:0] for x in (blocks, values)]
        inputs = [*rows, *before, *grads]
        wp.launch(_adjoint_kernel(scalar, size), P.nrow, inputs, device=P.device)

    if records:
        extend.record_adjoint(backward, [blocks, values])


def _one_by_one(matrix, block):
    """The blocks of numbers as matrices of one row."""
    return matrix.scalar_values.reshape((matrix.values.shape[0], 1, 1)).view(block).flatten()


def project_system_rhs(system_matrix, system_rhs, projector_matrix, fixed_value=None) -> None:
    """Sets b to (1 - P) (b - A P u) + P u.

    Args:
        system_matrix: A.
        system_rhs: b, in and out.
        projector_matrix: P, normalized.
        fixed_value: u; 0 by default.
    """
    rest = wp.clone(system_rhs)
    if fixed_value is None:
        system_rhs.zero_()
    else:
        bsr_mv(projector_matrix, fixed_value, system_rhs, alpha=1.0, beta=0.0)
        bsr_mv(system_matrix, system_rhs, rest, alpha=-1.0, beta=1.0)
    array_axpy(x=rest, y=system_rhs, alpha=1.0, beta=1.0)
    bsr_mv(projector_matrix, rest, system_rhs, alpha=-1.0, beta=1.0)


def project_system_matrix(system_matrix, projector_matrix) -> None:
    """Sets A to (1 - P) A (1 - P) + P; P is normalized."""
    complement = bsr_copy(system_matrix)
    bsr_mm(projector_matrix, system_matrix, complement, alpha=-1.0, beta=1.0)
    bsr_assign(dest=system_matrix, src=complement)
    bsr_axpy(projector_matrix, system_matrix)
    bsr_mm(complement, projector_matrix, system_matrix, alpha=-1.0, beta=1.0)


def project_linear_system(
    system_matrix, system_rhs, projector_matrix, fixed_value=None, normalize_projector=True
) -> None:
    """Imposes fixed values on a system: both sides are projected.

    Args:
        system_matrix: A, in and out.
        system_rhs: b, in and out.
        projector_matrix: P.
        fixed_value: values where P fixes them; 0 by default.
        normalize_projector: P and the values are first scaled so that P P = P.
    """
    if normalize_projector:
        normalize_dirichlet_projector(projector_matrix, fixed_value)
    project_system_rhs(system_matrix, system_rhs, projector_matrix, fixed_value)
    project_system_matrix(system_matrix, projector_matrix)


class Dirichlet:
    """Fixed values of a space.

    Attributes:
        nodes: int32, numbers of the fixed nodes.
        values: one element per node of the space, zero where nothing is fixed.
        projector: matrix whose diagonal is one at the fixed nodes.
    """

    def __init__(self, nodes, values, projector):
        self.nodes, self.values, self.projector = nodes, values, projector

    def project(self, system_matrix, system_rhs) -> None:
        """Imposes the values on a system, in place."""
        P, values = self.projector, self.values
        project_linear_system(system_matrix, system_rhs, P, values, normalize_projector=False)


def dirichlet(space, where=None, value=None, fields=None, values=None, device=None) -> Dirichlet:
    """Fixed values of a space on some elements.

    Args:
        space: the function space.
        where: domain whose nodes are fixed; by default all boundary sides.
        value: a number or vector for all nodes, or an integrand; 0 by default.
        fields, values: arguments of the integrand.
        device: where the system lives.

    Raises:
        ValueError: the domain is of another geometry.

    Example:
        >>> import warp as wp
        >>> from warp import fem
        >>> geo = fem.Grid2D(res=wp.vec2i(2, 2))
        >>> space = fem.make_polynomial_space(geo, degree=1)
        >>> bc = fem.dirichlet(space, value=2.0, device="cpu")
        >>> bc.values.numpy().tolist()
        [2.0, 2.0, 2.0, 2.0, 0.0, 2.0, 2.0, 2.0, 2.0]
    """
    from warp._src.fem.domains import BoundarySides
    from warp._src.fem.fields.discrete import DiscreteField, make_restriction
    from warp._src.fem.forms.integrand import Integrand
    from warp.sparse import bsr_set_from_triplets, bsr_zeros

    device = wp.get_device(device)
    where = BoundarySides(space.geometry) if where is None else where
    with extend.unrecorded():
        is_fixed = _nodes_on(space, where, device)
        nodes = wp.array(np.flatnonzero(is_fixed), dtype=wp.int32, device=device)
    dtype, count = extend.canonical(space.dof_dtype), space.node_count()
    fixed = wp.zeros(count, dtype=dtype, device=device)
    if value is not None:
        # Values may depend on positions and arrays that have gradients.
        fixed.requires_grad = isinstance(value, Integrand) and extend.is_recording()
        field = DiscreteField(space, dof_values=wp.zeros_like(fixed))
        if isinstance(value, Integrand):
            from warp._src.fem.interpolate import interpolate

            dest = make_restriction(field.trace(), domain=where, device=device)
            interpolate(value, dest=dest, fields=fields, values=values, device=device)
        else:
            field.dof_values.fill_(dtype(value))
        inputs = [nodes, field.dof_values, fixed]
        wp.launch(_keep_kernel(dtype), nodes.shape[0], inputs, device=device)
    size, scalar = extend.type_size(dtype), extend.type_scalar_type(dtype)
    block = scalar if size == 1 else wp.types.matrix(shape=(size, size), dtype=scalar)
    projector = bsr_zeros(count, count, block, device=device)
    one = 1.0 if size == 1 else block(*[float(i == j) for i in range(size) for j in range(size)])
    ones = wp.full(nodes.shape[0], one, dtype=block, device=device)
    bsr_set_from_triplets(projector, nodes, nodes, ones)
    return Dirichlet(nodes, fixed, projector)


@functools.cache
def _keep_kernel(dtype):
    def keep(nodes: wp.array(dtype=int), found: wp.array(dtype=dtype), kept: wp.array(dtype=dtype)):
        node = nodes[wp.tid()]
        kept[node] = found[node]

    return wp.kernel(keep)


def _nodes_on(space, where, device):
    """True for the nodes that values on a domain depend on, a NumPy array.

    Tangential values alone are continuous in covariant spaces, normal ones in contravariant
    spaces: edges that end on a side do not belong to it.
    """
    import warp._src.fem.operator as operators
    from warp._src.fem.fields.virtual import make_test, make_trial

    test = make_test(space, domain=where, device=device)
    trial = make_trial(space, domain=where)
    form = _mass
    if not where.is_cells and space.record.kind != "identity":
        form = {"covariant": _tangential_mass, "contravariant": _normal_mass}[space.record.kind]
    diagonal = operators.operator(form, {"u": trial, "v": test}, device=device).diagonal()
    numbers = diagonal.numpy().reshape(diagonal.shape[0], -1).max(axis=1)
    # Basis functions of nodes elsewhere are zero up to rounding.
    return numbers > 1.0e-7 * numbers.max(initial=0.0)


@integrand
def _mass(s: Sample, u: Field, v: Field):
    return generalized_inner(u(s), v(s))


@integrand
def _tangential_mass(s: Sample, domain: Domain, u: Field, v: Field):
    n = normal(domain, s)
    return wp.dot(u(s), v(s)) - wp.dot(u(s), n) * wp.dot(v(s), n)


@integrand
def _normal_mass(s: Sample, domain: Domain, u: Field, v: Field):
    n = normal(domain, s)
    return wp.dot(u(s), n) * wp.dot(v(s), n)
