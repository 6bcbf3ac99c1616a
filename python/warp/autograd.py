"""Checks of gradients, Jacobians, forward mode, second derivatives and checkpointing."""

from warp._src.autograd.checkpoints import checkpoint as checkpoint
from warp._src.autograd.checks import gradcheck as gradcheck
from warp._src.autograd.checks import gradcheck_tape as gradcheck_tape
from warp._src.autograd.evaluation import FunctionMetadata as FunctionMetadata
from warp._src.autograd.forward import hessian as hessian
from warp._src.autograd.forward import hvp as hvp
from warp._src.autograd.forward import jvp as jvp
from warp._src.autograd.jacobians import jacobian as jacobian
from warp._src.autograd.jacobians import jacobian_fd as jacobian_fd
from warp._src.autograd.metrics import adjoint_metrics as adjoint_metrics
from warp._src.autograd.plots import jacobian_plot as jacobian_plot
