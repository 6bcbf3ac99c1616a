"""Iterative solvers of linear systems, for `warp.optim.linear`.

`operators`: what a system is given by; `preconditioners`; `fsai` and what begins so: sparse
approximate inverses (class, plan, kernels); `dots`: inner products on the device;
`state`: what all solvers share, with the loop; `conjugate`, `fused`, `bicgstab`, `gmres`: their
iterations;
`adjoint`: gradients of solutions.
"""
