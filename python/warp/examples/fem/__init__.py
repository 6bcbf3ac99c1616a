"""Tools of finite-element examples: `warp.examples.fem.utils`."""
