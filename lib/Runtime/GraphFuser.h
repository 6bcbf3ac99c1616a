//===- GraphFuser.h - Groups of launches that are one -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHFUSER_H
#define WARP_LIB_RUNTIME_GRAPHFUSER_H

#include "FusedKernel.h"
#include "GraphFusion.h"
#include "ThreadElements.h"

#include <string>
#include <vector>

namespace warp {

/// The groups of launches that become one; those of a node alone stay as they
/// are.
class GraphFuser {
public:
  GraphFuser(std::vector<NodeRecord> &records, const GraphSchedule &schedule);
  FusedNodes run(bool joinsFills);

private:
  struct Launch {
    std::string why;
    /// Threads cannot run it one after the other with others.
    bool isTogether = false;
    std::vector<ThreadAccess> accesses;
  };

  /// Launches that are one.
  struct Group {
    std::vector<int> nodes;
    /// Blocks run rows.
    bool hasRows = false;
  };

  // GraphFusion.cpp: groups and the order of them.
  void join(int node);
  FusionPlan planOf(int group) const;
  FusedLaunch fuseGroup(int group);
  void merge(const std::vector<int> &nodes, NodeRecord &record) const;
  std::vector<int> orderOfGroups() const;

  // GraphFills.cpp: fills that are one node.
  void joinFills();
  std::vector<FillRegion> regionsOf(int group) const;
  bool saveJoins(int group) const;
  static void putFillsFirst(FusedNodes &nodes);

  // GraphFusionRules.cpp: launches that may be one.
  std::string whyNot(int group, int node, bool &hasRows) const;
  std::string whyNoRows(int group, int node) const;
  std::string whyOrdered(int group, int node, bool hasEdge) const;
  bool isShort(int node) const;
  bool leavesRoom(int node) const;
  bool isOnLongest(int node) const {
    return depth[node] + height[node] == longest;
  }
  bool isLike(int node, int other) const;
  bool mayBeRow(int node) const;
  bool mayBeOne(int node, int other) const;
  std::vector<int> before(int group) const;
  int readyOf(int group, int except = -1) const;
  bool reaches(int from, int to) const;

  std::vector<NodeRecord> &records;
  std::vector<std::vector<int>> edges, followers;
  /// The lengths of the longest paths to each node, from there on, and of all.
  std::vector<int> depth, height;
  int longest = 0;
  std::vector<Launch> launches;
  std::vector<int> groupOf;
  std::vector<Group> groups;
  /// The fills that all else comes behind; -1 if there are none.
  int firstFills = -1;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHFUSER_H
