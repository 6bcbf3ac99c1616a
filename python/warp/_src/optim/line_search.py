"""Line search for the strong Wolfe conditions (Nocedal and Wright, algorithms 3.5 and 3.6).

A trial at which the loss or its slope is not finite lies outside of the domain: the search halves
the distance to the last good point and never goes that far again. Close to a minimum, differences
of the loss drown in rounding, so that a trial counts as a decrease, too, if the loss is equal up to
rounding and the slope says so (the approximate Wolfe conditions of Hager and Zhang, 2005).
"""

from __future__ import annotations

import math

SUFFICIENT_DECREASE = 1e-4
CURVATURE = 0.9


class Point:
    """A point on the line: step, loss, slope along the line, and its gradient."""

    __slots__ = ("gradient", "loss", "slope", "step")

    def __init__(self, step, loss, slope, gradient):
        self.step = step
        self.loss = loss
        self.slope = slope
        self.gradient = gradient

    @property
    def is_finite(self) -> bool:
        return math.isfinite(self.loss) and math.isfinite(self.slope)


class LineSearch:
    """One search along a direction of descent.

    Args:
        evaluate: gives the `Point` of a step.
        start: the point of step 0.
        noise: rounding error of the loss near `start`.
        trials: most evaluations.
    """

    def __init__(self, evaluate, start, noise, trials=25):
        self.evaluate = evaluate
        self.start = start
        self.noise = noise
        self.trials = trials

    def run(self, step) -> Point:
        """A point that satisfies the conditions; the best one found if there is none in time."""
        start = previous = self.start
        limit = math.inf
        while self.trials > 0:
            point = self.trial(step)
            if not point.is_finite:
                limit = step
                step = 0.5 * (previous.step + step)
                continue
            if self.is_accepted(point):
                return point
            if self.is_too_far(point) or (previous is not start and point.loss >= previous.loss):
                return self.zoom(previous, point)
            if point.slope >= 0.0:
                return self.zoom(point, previous)
            ahead = interpolated(previous, point)
            step = min(max(ahead, 1.1 * point.step), 10.0 * point.step)
            step = min(step, 0.5 * (point.step + limit))
            previous = point
        return previous

    def zoom(self, low, high) -> Point:
        """Narrows an interval that holds acceptable points; `low` is the best one so far."""
        while self.trials > 0:
            step = 0.5 * (low.step + high.step)
            if math.isfinite(high.loss):
                margin = 0.1 * abs(high.step - low.step)
                least, most = sorted((low.step, high.step))
                step = min(max(interpolated(low, high), least + margin), most - margin)
            if step in (low.step, high.step):
                break
            point = self.trial(step)
            if not point.is_finite:
                high = Point(step, math.inf, math.nan, None)
                continue
            if self.is_accepted(point):
                return point
            if self.is_too_far(point) or point.loss >= low.loss:
                high = point
            else:
                if point.slope * (high.step - low.step) >= 0.0:
                    high = low
                low = point
        return low

    def trial(self, step) -> Point:
        self.trials -= 1
        return self.evaluate(step)

    def is_too_far(self, point) -> bool:
        start = self.start
        return point.loss > start.loss + SUFFICIENT_DECREASE * point.step * start.slope

    def is_accepted(self, point) -> bool:
        slope = self.start.slope
        if abs(point.slope) > -CURVATURE * slope:
            return False
        if not self.is_too_far(point):
            return True
        equal = point.loss <= self.start.loss + self.noise
        return equal and point.slope <= (2.0 * SUFFICIENT_DECREASE - 1.0) * slope


def backtrack(evaluate, step, trials=25) -> Point:
    """The point of a step, halved until loss and slope are finite there."""
    for _ in range(trials):
        point = evaluate(step)
        if point.is_finite:
            break
        step *= 0.5
    return point


def interpolated(a, b) -> float:
    """The minimum of the cubic through two points with slopes; half-way if it has none."""
    if a.step == b.step:
        return a.step
    middle = 0.5 * (a.step + b.step)
    first = a.slope + b.slope - 3.0 * (a.loss - b.loss) / (a.step - b.step)
    square = first * first - a.slope * b.slope
    if not square >= 0.0:
        return middle
    second = math.copysign(math.sqrt(square), b.step - a.step)
    divisor = b.slope - a.slope + 2.0 * second
    if divisor == 0.0:
        return middle
    found = b.step - (b.step - a.step) * (b.slope + second - first) / divisor
    return found if math.isfinite(found) else middle
