"""The loop of a solver, run by the host or by the device, and what it says of the result."""

import math
import warnings

import numpy as np

import warp as wp
from warp.extend import calling_frame


@wp.kernel(enable_backward=False)
def _count(step: int, progress: wp.array(dtype=int)):
    progress[0] = progress[0] + step


class Loops:
    """Repeats the `cycle` of a solver (see `state`) until all systems are solved or broken down."""

    def _advance(self) -> None:
        self.cycle()
        self.launch(_count, 1, self.cycle_size, self.progress)

    def _loop_on_host(self, callback, check_every, use_graph):
        limits = self.atol_sq.numpy().astype(float)
        atol = math.sqrt(limits.max())
        graph, done, true_before = None, 0, math.inf
        squares = self.r_norm_sq.numpy().astype(float)
        if callback is not None:
            callback(0, math.sqrt(squares.max()), atol)
        while not (squares <= limits).all() and done < self.maxiter:
            # Steps until the next check.
            for _ in range(max(1, check_every // self.cycle_size)):
                if use_graph and done:
                    if graph is None:
                        with wp.ScopedCapture(device=self.device) as capture:
                            self._advance()
                        graph = capture.graph
                    wp.capture_launch(graph)
                else:
                    self._advance()
                done += self.cycle_size
                if done >= self.maxiter:
                    break
            self.look_at_solution()
            squares = self.r_norm_sq.numpy().astype(float)
            broken = self.broken.numpy()
            stuck = ((broken >= 0) | (squares <= limits)).all()
            if stuck or done >= self.maxiter:
                self.start()
                squares = self.r_norm_sq.numpy().astype(float)
                if (broken >= 0).any() or squares.max() > true_before / 2:
                    # As good as numbers of this type get.
                    break
                true_before = squares.max()
            elif self.has_drifted(squares, limits):
                self.refresh()
            if callback is not None and not (squares <= limits).all():
                callback(done, math.sqrt(squares.max()), atol)
        error = math.sqrt(squares.max()) if squares.max() >= 0 else math.nan
        if callback is not None:
            callback(done, error, atol)
        self._report(squares, limits, done)
        return done, error, atol

    def has_drifted(self, squares, limits) -> bool:
        """True if the residual that iterations carry along is to be computed anew."""
        return False

    def refresh(self) -> None:
        """Computes the residual anew."""

    def guard(self) -> None:
        """Computes residuals that may have drifted anew, in a loop of the device."""

    def indefinite_systems(self):
        """Mask of the systems whose products have shown that the method is not made for them."""
        return np.zeros(self.batches, bool)

    def _report(self, squares, limits, done) -> None:
        """Notes a breakdown, and warns of one that left a system unsolved."""
        broken, unsolved = self.broken.numpy(), ~(squares <= limits)
        if unsolved.any():
            broken = np.where(unsolved & (broken < 0) & self.indefinite_systems(), done, broken)
        if not (broken >= 0).any():
            return
        self.breakdown = int(broken[broken >= 0].min())
        unsolved &= broken >= 0
        if unsolved.any():
            batch = int(unsolved.argmax())
            system = f" of system {batch}" if self.batches > 1 else ""
            frame = calling_frame()
            square = squares[batch]
            rest = f"{math.sqrt(square):.3g}" if square >= 0 else "no number: x is not finite"
            warnings.warn_explicit(
                f"{self.name}: breakdown{system} in iteration {broken[batch]}: the matrix is "
                f"singular, or not of the kind that this method needs; the residual is {rest}",
                UserWarning,
                frame.f_code.co_filename,
                frame.f_lineno,
            )

    def _loop_on_device(self, callback, use_graph, set_condition) -> None:
        condition = self.progress[1:2]
        state = (self.r_norm_sq, self.atol_sq, self.broken, self.maxiter)

        def check(step):
            self.launch(set_condition, 1, *state, step, self.progress)
            if isinstance(callback, wp.Kernel):
                arrays = (self.progress[0:1], *self._tell())
                self.launch(callback, 1, *arrays)

        def turn():
            self.cycle()
            check(self.cycle_size)
            if not unrolled:
                self.guard()

        def run():
            # Two rounds: where the residual of the first one is not the true one, a second one.
            for _ in range(2):
                wp.capture_while(condition, turn)
                self.start()
                check(0)

        unrolled = use_graph and self.device.is_cuda and not wp.is_conditional_graph_supported()
        check(0)
        if not unrolled:
            if self.device.is_cuda and use_graph and not self.device.is_capturing:
                with wp.ScopedCapture(device=self.device) as capture:
                    run()
                wp.capture_launch(capture.graph)
            else:
                run()
            return
        for _ in range(0, self.maxiter, self.cycle_size):
            turn()
        # The residual by its definition.
        self.start()
