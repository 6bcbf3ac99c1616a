//===- PoolCpus.h - CPU affinity of pool threads ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_POOLCPUS_H
#define WARP_LIB_RUNTIME_POOLCPUS_H

#include <string>
#include <vector>

namespace warp {

/// One entry per thread of the pool: its CPU, or -1 to leave it unpinned.
std::vector<int> choosePoolCpus();

/// CPUs that the quotas of control groups and their parents pay for; INT_MAX
/// without one. `groups`: a file as /proc/self/cgroup; `root`: the folder where
/// groups are mounted.
int quotaOfControlGroups(const std::string &groups, const std::string &root);

/// The same for the groups of this process.
int quotaOfOwnGroups();

} // namespace warp

#endif // WARP_LIB_RUNTIME_POOLCPUS_H
