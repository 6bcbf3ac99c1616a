"""`Volume`: sparse grids in NanoVDB buffers, and what kernels ask them.

layout        where a buffer has what, by type of its values
files         .nvdb files: segments, codecs
checks        whether a buffer is what it says
build         buffers made of tiles or voxels
contents      coordinates of tiles and voxels of a buffer
volume        `Volume`; `allocation`, `points`: what it is made of; `described`: what it says
queries       its functions in kernels; `typed`: those of one type; `places`: points and voxels
slot          where kernels find it
"""
