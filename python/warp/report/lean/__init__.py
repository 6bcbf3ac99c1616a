"""Lean reports of a scene: kernels, launches, memory and library parts that a run of it uses.

`python -m warp.report lean SCENE ...` runs one point of each scene and prints its manifest. Parts
that are present but unused (parameters, fields, gradients without a backward pass, kernels that are
never launched) is listed; the exit status is 1 if there is any.
"""
