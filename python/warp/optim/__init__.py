"""Optimisers of arrays: gradient descent, Adam, L-BFGS, and batches of small problems."""

from warp._src.optim.adam import Adam as Adam
from warp._src.optim.batched_lbfgs import BatchedLBFGS as BatchedLBFGS
from warp._src.optim.batched_least_squares import (
    BatchedLevenbergMarquardt as BatchedLevenbergMarquardt,
)
from warp._src.optim.lbfgs import LBFGS as LBFGS
from warp._src.optim.sgd import SGD as SGD
