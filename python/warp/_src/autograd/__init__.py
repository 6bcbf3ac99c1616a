"""Checks of gradients, Jacobians, forward mode, second derivatives and checkpointing."""

from warp._src.autograd.evaluation import FunctionMetadata as FunctionMetadata
