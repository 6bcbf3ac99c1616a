"""Functions of arrays that are written with kernels, or with indexed arrays, and so above them.

`arrays.array`, `arrays.indexed`, `kernels.call` and `kernels.maps` put them here. All are part of
`import warp`.
"""

from __future__ import annotations

import typing

# apply(name, expression, names, text, operands, out, ...): a function of elements, see `maps`.
apply: typing.Callable
# copy_elements(dest, src, stream): a copy between arrays of which one is indexed at least.
copy_elements: typing.Callable
# select(source, key): what `source[key]` is if there are arrays in the key.
select: typing.Callable
# `wp.array` itself: programs derive classes from it whose arguments are their own.
plain_array: type
# check_settled(array): rejects reading what work that is being captured writes.
check_settled: typing.Callable
# signature_of(kernel, native, values): facts about arguments of a launch that observers need.
signature_of: typing.Callable
# reduce_array(array, protocol): the parts that an array is pickled as.
reduce_array: typing.Callable
# Captures in progress: by stream handle on CUDA, by thread on the CPU.
captures: dict = {}
# For a capture, by its key: what makes the graph, where that is not `Graph` itself.
graph_makers: dict = {}
