"""Gradients that last for one backward pass of another library.

The library keeps the memory of what it is given as a gradient, so the next pass has to begin with
other memory, of zeros, for the array and for its views.
"""

from __future__ import annotations

import weakref

from warp._src.arrays.gradients import make_gradient


class PassingGradient:
    """The source of an array's gradient, as an array's `_grad_source` is asked.

    Args:
        array: an array without gradient, which gets this one.
        at_end: has a function called when the pass that runs is over; gives False where none runs,
            and the gradient stays.
    """

    # Nothing is in it before it is asked for.
    grad_in_use = None

    def __init__(self, array, at_end):
        self._array, self._at_end = weakref.ref(array), at_end
        self._made: list = []
        self.passing = self
        array._requires_grad, array._grad_source = True, (self, _itself)

    @property
    def grad(self):
        """Zeros for the array."""
        return make_gradient(self._array())

    def follow(self, array, gradient) -> None:
        """Called when an array gets a gradient from here, or from an array that has."""
        if not self._made and not self._at_end(self._forget):
            return
        array.passing = self
        self._made.append((weakref.ref(array), array._grad_source, gradient))

    def _forget(self) -> None:
        """Takes the gradients from arrays that still have them."""
        made, self._made = self._made, []
        for reference, source, gradient in made:
            array = reference()
            if array is not None and array._grad is gradient:
                retained = array._retain_grad
                array.grad = None
                array._requires_grad, array._grad_source = True, source
                array._retain_grad = retained


def _itself(gradient):
    return gradient
