"""The Adam optimiser (Kingma and Ba, arXiv 1412.6980, algorithm 1)."""

import functools

import warp as wp
from warp._src.optim import parameters
from warp.extend import checked
from warp.extend.kinds import ARRAY, ARRAYS, BETAS, COUNT, NUMBER


@functools.cache
def _step_kernel(gradient, number, real):
    """The update of parameters of type `number` with state of type `real`."""

    def adam_step(
        g: wp.array(dtype=gradient),
        m: wp.array(dtype=real),
        v: wp.array(dtype=real),
        lr: real,
        beta1: real,
        beta2: real,
        correction1: real,
        correction2: real,
        eps: real,
        params: wp.array(dtype=number),
    ):
        i = wp.tid()
        one = real(1.0)
        slope = real(g[i])
        m[i] = beta1 * m[i] + (one - beta1) * slope
        v[i] = beta2 * v[i] + (one - beta2) * slope * slope
        change = lr * (m[i] / correction1) / (wp.sqrt(v[i] / correction2) + eps)
        params[i] = number(real(params[i]) - change)

    name = f"adam_step_{gradient.__name__}_{number.__name__}_{real.__name__}"
    return wp.kernel(adam_step, name=name, module=__name__)


class Adam:
    """Adaptive moment estimation: steps scaled by running averages of gradient and its square.

    Args:
        params: list of arrays to optimise, of floating-point scalars, vectors, matrices,
            quaternions or transforms; None if `set_params` is called later.
        lr: length of a step.
        betas: decay per step of the averages of the gradient and of its square.
        eps: added to the root of the second average.

    Attributes:
        m, v: the averages, one array per parameter, with components of at least 32 bits.
        t: steps taken.

    Example:
        >>> import warp as wp
        >>> from warp.optim import Adam
        >>> x = wp.array([1.0, 2.0], dtype=float, device="cpu")
        >>> optimizer = Adam([x], lr=0.1)
        >>> for _ in range(200):
        ...     optimizer.step([wp.array(2.0 * x.numpy(), dtype=float, device="cpu")])
        >>> bool(abs(x.numpy()).max() < 0.05)
        True
    """

    @checked(params=ARRAYS, betas=BETAS)
    def __init__(self, params=None, lr=0.001, betas=(0.9, 0.999), eps=1e-08):
        self.m = []
        self.v = []
        self.set_params(params)
        self.lr = lr
        self.beta1, self.beta2 = betas
        self.eps = eps
        self.t = 0

    @checked(params=ARRAYS)
    def set_params(self, params) -> None:
        """Sets the arrays to optimise; averages that fit them are kept.

        Raises:
            TypeError: no list of arrays of floating-point numbers.
        """
        self.params = parameters.check_list(params, "Adam")
        if params:
            self.m = parameters.fitting_state(self.m, params)
            self.v = parameters.fitting_state(self.v, params)

    def reset_internal_state(self) -> None:
        """Forgets the averages and starts counting steps anew."""
        for state in (*self.m, *self.v):
            state.zero_()
        self.t = 0

    @checked(grad=ARRAYS)
    def step(self, grad) -> None:
        """Changes the parameters by one step.

        Args:
            grad: one gradient per parameter, of its type or that of its averages.

        Raises:
            RuntimeError: there are no parameters yet.
            TypeError, ValueError: a gradient does not fit its parameter.
        """
        parameters.check_gradients(grad, self.params, "Adam")
        settings = (self.lr, self.beta1, self.beta2, self.t, self.eps)
        for g, m, v, param in zip(grad, self.m, self.v, self.params, strict=True):
            self.step_detail(g, m, v, *settings, param)
        self.t += 1

    @staticmethod
    @checked(g=ARRAY, m=ARRAY, v=ARRAY, beta1=NUMBER, beta2=NUMBER, t=COUNT, params=ARRAY)
    def step_detail(g, m, v, lr, beta1, beta2, t, eps, params) -> None:
        """The step of one array; `t` counts the steps before it."""
        parameters.check_gradient(g, params, "Adam")
        g, m, v = (parameters.flat(values.contiguous()) for values in (g, m, v))
        # The averages decay by what the kernel gets, rounded to its type.
        decays = [m.dtype(beta).value for beta in (beta1, beta2)]
        corrections = [1.0 - decay ** (t + 1) for decay in decays]
        step = _step_kernel(g.dtype, parameters.scalar_of(params.dtype), m.dtype)

        def run(components):
            inputs = [g, m, v, lr, beta1, beta2, *corrections, eps, components]
            wp.launch(step, g.size, inputs, device=params.device)

        parameters.update(params, run)
