"""L-BFGS: a quasi-Newton method for smooth functions of many variables.

Nocedal and Wright, Numerical Optimization (2006), chapter 7. The host decides, from a few numbers
per evaluation (loss, slope, sizes); vectors stay on the device, see `lbfgs_vectors`.
"""

from __future__ import annotations

import math

import warp as wp
from warp._src.optim import parameters
from warp._src.optim.lbfgs_vectors import Vectors
from warp._src.optim.line_search import LineSearch, Point, backtrack
from warp.extend import checked, errors
from warp.extend.kinds import ARRAYS, CALLABLE, INTEGER, NUMBER, TEXT

LINE_SEARCHES = ("strong_wolfe", None)


class LBFGS:
    """Minimises a smooth function by steps that learn its curvature from former gradients.

    Args:
        params: list of arrays to optimise, of floating-point scalars, vectors, matrices,
            quaternions or transforms, all on one device and with gradients
            (`requires_grad=True`).
        lr: first step to try in each iteration; 1 is what the method is made for.
        max_iter: most iterations per call of `step`.
        history_size: changes that the approximation of the curvature is made from.
        tolerance_grad: stop when no component of the gradient is larger.
        tolerance_change: stop when neither the loss nor a parameter changes by more.
        line_search: "strong_wolfe", or None to take steps of length `lr` as they are. Both halve a
            step that leads to a loss or gradient that is not finite.

    Attributes:
        iterations, evaluations: steps taken and calls of closures so far.

    Example:
        >>> import numpy as np
        >>> import warp as wp
        >>> x = wp.array([3.0, -2.0], dtype=wp.float64, device="cpu", requires_grad=True)
        >>> def closure():
        ...     x.grad.assign(2.0 * x.numpy() * np.array([1.0, 100.0]))
        ...     return float((x.numpy() ** 2 * [1.0, 100.0]).sum())
        >>> loss = wp.optim.LBFGS([x]).step(closure)
        >>> loss < 1e-12
        True
    """

    @checked(
        params=ARRAYS,
        max_iter=INTEGER,
        history_size=INTEGER,
        tolerance_grad=NUMBER,
        tolerance_change=NUMBER,
        line_search=TEXT,
    )
    def __init__(
        self,
        params=None,
        lr=1.0,
        max_iter=20,
        history_size=10,
        tolerance_grad=1e-7,
        tolerance_change=1e-9,
        line_search="strong_wolfe",
    ):
        for name, value in (("max_iter", max_iter), ("history_size", history_size)):
            if not isinstance(value, int) or value < 1:
                raise ValueError(f"LBFGS expects a positive int as {name}, but got {value!r}")
        if not (lr > 0.0 and math.isfinite(lr)):
            raise ValueError(f"LBFGS expects a positive lr, but got {lr!r}")
        if line_search not in LINE_SEARCHES:
            raise ValueError(
                f'LBFGS expects "strong_wolfe" or None as line_search, but got {line_search!r}'
            )
        self.lr = float(lr)
        self.max_iter = max_iter
        self.history_size = history_size
        self.tolerance_grad = tolerance_grad
        self.tolerance_change = tolerance_change
        self.line_search = line_search
        self.set_params(params)

    @checked(params=ARRAYS)
    def set_params(self, params) -> None:
        """Sets the arrays to optimise and forgets what was learned.

        Raises:
            TypeError: no list of arrays of floating-point numbers.
            ValueError: they are empty or on several devices, or one has no gradient.
        """
        self.params = parameters.check_list(params, "LBFGS")
        self.vectors = None
        if params is not None:
            if not params or not any(param.size for param in params):
                raise ValueError("LBFGS: there is nothing to optimise, all parameters are empty")
            for position, param in enumerate(params):
                if param.device != params[0].device:
                    raise ValueError(
                        f"LBFGS: parameter 0 is on '{params[0].device}', "
                        f"but parameter {position} on '{param.device}'"
                    )
                if not param.requires_grad:
                    raise ValueError(
                        f"LBFGS: parameter {position} has no gradient, make it with "
                        "`requires_grad=True`"
                    )
            self.vectors = Vectors(params, self.history_size)
        self.iterations = self.evaluations = 0

    def reset_internal_state(self) -> None:
        """Forgets former gradients, and counts from 0."""
        if self.vectors is not None:
            self.vectors.forget()
        self.iterations = self.evaluations = 0

    @checked(closure=CALLABLE)
    def step(self, closure) -> float:
        """Takes up to `max_iter` steps; leaves the parameters and their gradients at the best one.

        Args:
            closure: called without arguments, returns the loss at the parameters (a number, or an
                array with one element) and adds its gradient to `grad` of each parameter, which is
                zero when it is called.

        Returns:
            The loss at the parameters.

        Raises:
            WarpError: loss or gradient are not finite at the first point.
        """
        vectors = self.vectors
        if vectors is None:
            raise RuntimeError("LBFGS parameters must be set before calling step(), got None")
        vectors.gather(self.params, vectors.x)
        here, most, total = self._evaluate(closure, 0.0)
        if not (math.isfinite(here.loss) and math.isfinite(total)):
            raise errors.WarpError(
                f"LBFGS: the loss is {here.loss} and the largest component of its gradient {most} "
                "at the first point, expects finite numbers"
            )
        last = here
        for _ in range(self.max_iter):
            if most <= self.tolerance_grad:
                break
            found = self._search(closure, here)
            if found is None:
                break
            last, point, most, longest = found
            change = abs(point.loss - here.loss)
            here = point
            if min(change, abs(here.step) * longest) <= self.tolerance_change:
                break
        self._settle(here, last)
        return here.loss

    def _search(self, closure, here):
        """One iteration: (last point tried, new point, largest |gradient|, largest |direction|).

        None if no step along the direction of steepest descent helps.
        """
        vectors = self.vectors
        while True:
            vectors.find_direction(here.gradient)
            slope, total, _, longest = vectors.measure(here.gradient)
            start = Point(0.0, here.loss, slope, here.gradient)
            if slope < 0.0 and math.isfinite(longest):
                step = self.lr if vectors.used else self.lr * min(1.0, 1.0 / total)
                tried: list = []
                point = self._along(closure, start, step, tried)
                if point.step != 0.0 and point.is_finite:
                    break
            if not vectors.used:
                return None
            vectors.forget()
        most = next(size for at, size in tried if at is point)
        vectors.remember(point.step, point.gradient, here.gradient)
        vectors.move(point.step)
        vectors.x.assign(vectors.trial)
        self.iterations += 1
        return tried[-1][0], point, most, longest

    def _along(self, closure, start, step, tried):
        """The point of the line search; `tried` gets all points with their largest |gradient|."""

        def evaluate(step):
            self.vectors.move(step)
            self.vectors.scatter(self.vectors.trial, self.params)
            point, most, total = self._evaluate(closure, step)
            if not math.isfinite(total):
                point.slope = math.nan
            tried.append((point, most))
            return point

        if self.line_search is None:
            return backtrack(evaluate, step)
        noise = 8.0 * self._loss_epsilon * abs(start.loss)
        return LineSearch(evaluate, start, noise).run(step)

    def _evaluate(self, closure, step):
        """The point where the parameters are, largest component and sum of its gradient."""
        for param in self.params:
            param.grad.zero_()
        self.evaluations += 1
        loss = self._number(closure())
        gradient = self.vectors.vector()
        self.vectors.gather([param.grad for param in self.params], gradient)
        slope, total, most, _ = self.vectors.measure(gradient)
        return Point(step, loss, slope, gradient), most, total

    def _number(self, loss) -> float:
        """The result of a closure as a number; notes how exact it is."""
        self._loss_epsilon = self.vectors.precision
        if isinstance(loss, wp.array):
            if loss.size != 1:
                raise errors.WarpShapeError(
                    f"LBFGS: expects one loss from the closure, but got shape {loss.shape}"
                )
            self._loss_epsilon = parameters.epsilon(loss.dtype)
            return float(loss.numpy().reshape(-1)[0])
        try:
            return float(loss)
        except (TypeError, ValueError):
            raise TypeError(
                "LBFGS: expects the loss from the closure, a number or an array with one element, "
                f"but got '{type(loss).__name__}'"
            ) from None

    def _settle(self, here, last) -> None:
        """Puts back the best point where another one was tried last."""
        if here is not last:
            self.vectors.scatter(self.vectors.x, self.params)
            self.vectors.scatter(here.gradient, [param.grad for param in self.params])
