"""`Volume`: sparse grids in NanoVDB buffers, and what kernels ask them.

volume        `Volume`, over that of C++, which reads, checks, writes and makes grids
              (lib/Geometry/Volumes); `allocation`, `points`: what it is made of; `described`,
              `contents`: what it says
queries       its functions in kernels; `typed`: those of one type; `places`: points and voxels;
              `cells`: where values are
"""
