"""Checks of gradients, Jacobians, forward mode, second derivatives and checkpointing."""
