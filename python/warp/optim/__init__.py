"""Optimisers of arrays: gradient descent, Adam and L-BFGS."""

from warp._src.optim.adam import Adam as Adam
from warp._src.optim.lbfgs import LBFGS as LBFGS
from warp._src.optim.sgd import SGD as SGD
