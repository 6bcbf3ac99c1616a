"""Gradient descent with momentum, as in Sutskever et al., ICML 2013."""

import functools

import warp as wp
from warp._src.optim import parameters
from warp.extend import checked
from warp.extend.kinds import ARRAY, ARRAYS, COUNT, FLAG, NUMBER


@functools.cache
def _step_kernel(gradient, number, real):
    """The update of parameters of type `number` with momentum of type `real`."""

    def sgd_step(
        g: wp.array(dtype=gradient),
        b: wp.array(dtype=real),
        lr: real,
        momentum: real,
        dampening: real,
        weight_decay: real,
        nesterov: bool,
        first: bool,
        params: wp.array(dtype=number),
    ):
        i = wp.tid()
        change = real(g[i])
        if weight_decay != real(0.0):
            change += weight_decay * real(params[i])
        if momentum != real(0.0):
            velocity = change
            if not first:
                velocity = momentum * b[i] + (real(1.0) - dampening) * change
            b[i] = velocity
            if nesterov:
                change += momentum * velocity
            else:
                change = velocity
        params[i] = number(real(params[i]) - lr * change)

    name = f"sgd_step_{gradient.__name__}_{number.__name__}_{real.__name__}"
    return wp.kernel(sgd_step, name=name, module=__name__)


class SGD:
    """Gradient descent with momentum.

    Args:
        params: list of arrays to optimise, of floating-point scalars, vectors, matrices,
            quaternions or transforms; None if `set_params` is called later.
        lr: length of a step, per unit of the gradient.
        momentum: share of the former change that a step keeps.
        dampening: share of the gradient that does not enter the momentum.
        weight_decay: weight of half the squared parameters, added to what is minimised.
        nesterov: take the gradient where the momentum leads.

    Attributes:
        b: the momentum, one array per parameter, with components of at least 32 bits.
        t: steps taken.

    Example:
        >>> import warp as wp
        >>> from warp.optim import SGD
        >>> x = wp.array([1.0, 2.0], dtype=float, device="cpu")
        >>> SGD([x], lr=0.5).step([wp.array([1.0, 1.0], dtype=float, device="cpu")])
        >>> x.numpy().tolist()
        [0.5, 1.5]
    """

    @checked(params=ARRAYS, momentum=NUMBER, dampening=NUMBER, weight_decay=NUMBER, nesterov=FLAG)
    def __init__(
        self,
        params=None,
        lr=0.001,
        momentum=0.0,
        dampening=0.0,
        weight_decay=0.0,
        nesterov=False,
    ):
        self.b = []
        self.set_params(params)
        self.lr = lr
        self.momentum = momentum
        self.dampening = dampening
        self.weight_decay = weight_decay
        self.nesterov = nesterov
        self.t = 0

    @checked(params=ARRAYS)
    def set_params(self, params) -> None:
        """Sets the arrays to optimise; momentum that fits them is kept.

        Raises:
            TypeError: no list of arrays of floating-point numbers.
        """
        self.params = parameters.check_list(params, "SGD")
        if params:
            self.b = parameters.fitting_state(self.b, params)

    def reset_internal_state(self) -> None:
        """Forgets the momentum and starts counting steps anew."""
        for state in self.b:
            state.zero_()
        self.t = 0

    @checked(grad=ARRAYS)
    def step(self, grad) -> None:
        """Changes the parameters by one step.

        Args:
            grad: one gradient per parameter, of its type or that of its momentum.

        Raises:
            RuntimeError: there are no parameters yet.
            TypeError, ValueError: a gradient does not fit its parameter.
        """
        parameters.check_gradients(grad, self.params, "SGD")
        settings = (self.lr, self.momentum, self.dampening, self.weight_decay, self.nesterov)
        for g, b, param in zip(grad, self.b, self.params, strict=True):
            self.step_detail(g, b, *settings, self.t, param)
        self.t += 1

    @staticmethod
    @checked(
        g=ARRAY,
        b=ARRAY,
        momentum=NUMBER,
        dampening=NUMBER,
        weight_decay=NUMBER,
        t=COUNT,
        nesterov=FLAG,
        params=ARRAY,
    )
    def step_detail(g, b, lr, momentum, dampening, weight_decay, nesterov, t, params) -> None:
        """The step of one array; `t` counts the steps before it."""
        parameters.check_gradient(g, params, "SGD")
        g, b = (parameters.flat(values.contiguous()) for values in (g, b))
        step = _step_kernel(g.dtype, parameters.scalar_of(params.dtype), b.dtype)
        settings = [lr, momentum, dampening, weight_decay, bool(nesterov), t == 0]

        def run(components):
            wp.launch(step, g.size, [g, b, *settings, components], device=params.device)

        parameters.update(params, run)
