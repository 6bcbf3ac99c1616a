//===- Fusion.h - Several kernels as one ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_FUSION_H
#define WARP_FUSION_H

#include "warp/Builder.h"
#include "warp/Export.h"

#include <string>
#include <vector>

namespace warp {

/// A kernel that becomes part of another one, and the argument of that which
/// each of its own is.
struct FusionPart {
  const Module *module = nullptr;
  std::vector<int> arguments;
  /// For blocks that run rows: the extents of the launch behind the first one,
  /// and true if threads of the block wait before it.
  std::vector<int64_t> inner = {};
  bool waits = false;
};

/// A kernel whose threads run the parts one after the other. Operations keep
/// their places in the source. Throws `Error` of kind `Compile` if a part is no
/// plain kernel, such as a derivative. With `blockThreads`, a block of so many
/// threads runs the parts for an index of their first extent, a row.
WARP_API Module fuseKernels(const std::string &name,
                            const std::vector<FusionPart> &parts,
                            int64_t blockThreads = 0);

/// False if graphs that this thread captures keep launches as they were
/// recorded.
WARP_API bool fusesLaunches();
WARP_API void setFusesLaunches(bool fuses);
/// The same for launches that blocks run by rows, on GPUs, and to be tested on
/// CPUs.
WARP_API void setFusesRows(bool fuses);
WARP_API void setFusesRowsOnHost(bool fuses);

} // namespace warp

#endif // WARP_FUSION_H
