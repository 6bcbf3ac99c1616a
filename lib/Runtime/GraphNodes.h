//===- GraphNodes.h - Access regions of a graph's nodes ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHNODES_H
#define WARP_LIB_RUNTIME_GRAPHNODES_H

#include "GraphTrace.h"
#include "warp/Regions.h"

#include <string>
#include <vector>

namespace warp {

/// From here on addresses stand for what has no memory: the output of kernels
/// that print, then conditions by their number.
inline constexpr uint64_t outputAddress = uint64_t(15) << 60;
/// That of fills which all else of a graph comes behind.
inline constexpr uint64_t fillsAddress = outputAddress - 1;

/// Memory that a node reads or writes. An atomic update counts as a write:
/// within its launch it may be a plain read and write of one thread.
struct NodeAccess {
  Region region;
  bool writes = false;
  /// The parameter of a launch; empty for other operations.
  std::string name;
  bool isOnHost = false;
};

/// The operations of one call, as far as the order of a graph depends on them.
struct NodeRecord {
  std::string name;
  std::vector<NodeAccess> accesses;
  /// Why the node keeps its order with all others: it may touch anything.
  /// Empty if it does not.
  std::string barrier;
  /// False if another library may have added nodes.
  bool isOwn = true;
  /// Threads of all launches; bytes of all regions.
  int64_t threads = 0, bytes = 0;
  /// The only operation, if that is a launch.
  const GraphOperation *launch = nullptr;
  /// The same of a fill of memory without gaps.
  const GraphOperation *fill = nullptr;
  /// The launches of a fused one, and why it is not fused with one before.
  std::vector<std::string> parts;
  std::string apart;
};

/// Operations [first, last) of a trace.
NodeRecord recordOf(const GraphTrace &trace, size_t first, size_t last);

/// A node of which nothing is known.
NodeRecord unknownNode(std::string what);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHNODES_H
