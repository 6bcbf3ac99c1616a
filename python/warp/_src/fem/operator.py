"""Matrix-free operators - action, adjoint and diagonal of a bilinear form without its matrix."""

import functools
from types import SimpleNamespace

import warp as wp
from warp import extend
from warp._src.fem.assembly.gather import add_blocks
from warp._src.fem.assembly.matrix import pattern_of
from warp._src.fem.assembly.pattern import Pattern, node_batches
from warp._src.fem.assembly.vector import as_vector, assemble_vector
from warp._src.fem.fields.discrete import DiscreteField
from warp._src.fem.fields.virtual import make_test
from warp._src.fem.forms.form import Form
from warp._src.fem.forms.tables import node_table
from warp._src.fem.integrate import form_of
from warp._src.fem.linalg import array_axpy
from warp.optim.linear import LinearOperator


@functools.cache
def _diagonal_kernel(block, dof):
    is_matrix = extend.type_is_matrix(block)
    is_vector = extend.type_is_vector(dof)

    def read_diagonal(
        blocks: wp.array(dtype=block), rows: int, columns: int, diagonal: wp.array(dtype=dof)
    ):
        e, i = wp.tid()
        value = blocks[(e * rows + i) * columns + i]
        if wp.static(not is_matrix):
            diagonal[e * rows + i] = value
        elif wp.static(is_vector):
            diagonal[e * rows + i] = wp.get_diag(value)
        else:
            diagonal[e * rows + i] = value[0, 0]

    return wp.kernel(read_diagonal, enable_backward=False)


class FormOperator(LinearOperator):
    """The operator of a bilinear form: solvers of `warp.optim.linear` take it as a matrix.

    Vectors have an element of the space's degree of freedom for each node, or its numbers.

    Attributes:
        adjoint: the operator with test and trial function exchanged.
    """

    def __init__(self, form: Form, accumulate_dtype, temporary_store):
        self._form, self._accumulate, self._store = form, accumulate_dtype, temporary_store
        test, trial = form.test, form.trial
        rows, columns = (f.space_partition.node_count() for f in (test, trial))
        self._counts = rows, columns
        size = rows * test.node_dof_count, columns * trial.node_dof_count
        self._field = DiscreteField(trial.space, trial.space_partition)
        fields = {**form.fields, form.trial_name: self._field}
        self._action = Form(
            form.integrand, form.domain, form.quadrature, fields, form.values, form.device,
            form.kernel_options,
        )  # fmt: skip
        super().__init__(size, form.record.scalar, form.device, matvec=self._multiply)

    def apply(self, x, out=None):
        """The product with a vector: a new array of the test space, or `out`."""
        test = self._form.test
        if out is None:
            out = wp.empty(self._counts[0], dtype=test.dof_dtype, device=self.device)
        self._act(x, as_vector(out, test.dof_dtype, self._counts[0]))
        return out

    def _act(self, x, out) -> None:
        trial = self._form.trial
        self._field.dof_values = as_vector(x, trial.dof_dtype, self._counts[1])
        assemble_vector(self._action, out, self._accumulate, False, self._store)

    def _multiply(self, x, y, z, alpha, beta) -> None:
        dtype, rows = self._form.test.dof_dtype, self._counts[0]
        target = as_vector(z, dtype, rows)
        if alpha == 1.0 and beta == 0.0 and x.ptr != z.ptr:
            self._act(x, target)
            return
        product = wp.empty(rows, dtype=dtype, device=self.device)
        self._act(x, product)
        if beta == 0.0:
            # Numbers of `y` do not count then, NaN neither.
            target.zero_()
        elif y.ptr != z.ptr:
            wp.copy(target, as_vector(y, dtype, rows))
        with extend.unrecorded():
            array_axpy(product, target, alpha, beta)

    @functools.cached_property
    def adjoint(self) -> "FormOperator":
        """The transposed operator."""
        form = self._form
        test = make_test(
            form.trial.space, space_partition=form.trial.space_partition, domain=form.domain
        )
        from warp._src.fem.fields.virtual import TrialField

        trial = TrialField(form.test.space, form.test.space_partition, form.domain)
        fields = {**form.fields, form.trial_name: test, form.test_name: trial}
        swapped = Form(
            form.integrand, form.domain, form.quadrature, fields, form.values, form.device,
            form.kernel_options,
        )  # fmt: skip
        return FormOperator(swapped, self._accumulate, self._store)

    def diagonal(self):
        """The diagonal, an element per node of the test space.

        Raises:
            ValueError: test and trial space differ.
        """
        form = self._form
        test, trial = form.test, form.trial
        if test.space.topology != trial.space.topology or self.shape[0] != self.shape[1]:
            raise ValueError("a diagonal expects the same space for test and trial function")
        dof, device = extend.canonical(test.dof_dtype), form.device
        table = form.test_table(device)
        width = table.shape[1]
        size = wp.types.type_size_in_bytes(form.block_dtype)
        result = wp.zeros(self._counts[0], dtype=dof, device=device)
        for batch in node_batches(table, self._counts[0], size * width):
            blocks = wp.empty(batch.count * width * width, dtype=form.block_dtype, device=device)
            form.blocks(batch.first, batch.count, blocks)
            diagonal = wp.empty(batch.count * width, dtype=dof, device=device)
            kernel = _diagonal_kernel(extend.canonical(form.block_dtype), dof)
            inputs = [blocks, width, width, diagonal]
            wp.launch(kernel, (batch.count, width), inputs, device=device)
            add_blocks(batch, diagonal, result, True, self._accumulate)
        return result


def operator(
    integrand,
    fields,
    values=None,
    domain=None,
    quadrature=None,
    accumulate_dtype=wp.float64,
    device=None,
    temporary_store=None,
    kernel_options=None,
) -> FormOperator:
    """A bilinear form as a linear operator, without its matrix.

    Args:
        integrand: the form.
        fields: by name; one test and one trial function.
        values: arguments of the other parameters, by name.
        domain, quadrature, accumulate_dtype, device, temporary_store, kernel_options: as in
            `integrate`.

    Returns:
        A `LinearOperator` with `apply(x)`, `adjoint` and `diagonal()`.

    Raises:
        ValueError: a test or trial function is missing.

    Example:
        >>> import warp as wp
        >>> from warp import fem
        >>> @fem.integrand
        ... def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
        ...     return u(s) * v(s)
        >>> geo = fem.Grid2D(res=wp.vec2i(2, 2))
        >>> space = fem.make_polynomial_space(geo, degree=1)
        >>> fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
        >>> A = fem.operator(mass, fields, device="cpu")
        >>> ones = wp.ones(space.node_count(), dtype=float, device="cpu")
        >>> round(float(A.apply(ones).numpy().sum()), 6)
        1.0
    """
    form = form_of(integrand, domain, quadrature, fields, values, device, kernel_options)
    if form.test is None or form.trial is None:
        raise ValueError(
            f"'operator' expects a test and a trial function, but '{integrand.name}' got "
            f"{sorted(fields)}"
        )
    return FormOperator(form, accumulate_dtype, temporary_store)


def pattern(test, trial, device=None) -> Pattern:
    """The sparsity of all bilinear forms of a test and a trial function, from their tables alone.

    Args:
        test, trial: the functions, on one domain.
        device: where the pattern lives.

    Returns:
        `offsets` and `columns`, int32 arrays of a sparse matrix, `nnz` and `shape`.

    Raises:
        ValueError: the functions are defined on different domains.
    """
    if test.domain != trial.domain:
        raise ValueError(
            f"expects functions on one domain, but the test function is on '{test.domain.name}', "
            f"the trial function on '{trial.domain.name}'"
        )
    device, domain = wp.get_device(device), test.domain
    form = SimpleNamespace(test=test, trial=trial, domain=domain, device=device)
    form.block_dtype = wp.float32
    form.test_table = functools.partial(node_table, test, domain)
    form.trial_table = functools.partial(node_table, trial, domain)
    return pattern_of(form)
