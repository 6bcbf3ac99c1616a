"""Several processes on engines of others: communicators, plans, operations on the tape.

communicator  `Communicator`, the interface of engines; one process alone; `init`
mpi, torch, nccl   engines
failures      errors, time limits, log of the ranks of a host, exit of all ranks
plans         messages with packed buffers, checked once over all ranks
watch         a thread that ends ranks when work on a GPU does not end
forward       tangents, which go the way of values
operations    reductions and movements on arrays, with adjoints
exact         sums with the same bits on any number of ranks
blocks, particles, graphs   parts of grids, particles, meshes and sparse patterns
solvers       products and solvers whose vectors have a part on each rank
checkpoints, processes      files of all ranks; shared memory, warm caches, progress
"""
