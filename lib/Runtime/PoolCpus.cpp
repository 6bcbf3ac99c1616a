//===- PoolCpus.cpp - CPU affinity of pool threads ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As many threads as the process may use CPUs, less where its control group, or
// a parent of it, pays for fewer. WARP_NUM_THREADS asks for another number, and
// without it OMP_NUM_THREADS, which launchers of several processes set.
//
//===----------------------------------------------------------------------===//

#include "PoolCpus.h"

#include "Support.h"

#include <algorithm>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sched.h>
#include <string>

using namespace warp;

static std::string firstLine(const std::string &path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

/// CPUs that a quota pays for, rounded up; INT_MAX without one.
static int cpusOf(long long quota, long long period) {
  if (quota <= 0 || period <= 0)
    return INT_MAX;
  return static_cast<int>(
      std::min<long long>(INT_MAX, (quota + period - 1) / period));
}

/// Quota of one group of version 2, then of version 1.
static int quotaOfGroup(const std::string &folder) {
  long long quota = 0, period = 0;
  if (std::sscanf(firstLine(folder + "/cpu.max").c_str(), "%lld %lld", &quota,
                  &period) == 2)
    return cpusOf(quota, period);
  quota = std::atoll(firstLine(folder + "/cpu.cfs_quota_us").c_str());
  period = std::atoll(firstLine(folder + "/cpu.cfs_period_us").c_str());
  return cpusOf(quota, period);
}

int warp::quotaOfControlGroups(const std::string &groups,
                               const std::string &root) {
  int least = INT_MAX;
  auto consider = [&](const std::string &mount, std::string path) {
    // The process's own group, its parents and the root.
    for (;;) {
      least = std::min(least, quotaOfGroup(mount + path));
      size_t slash = path.rfind('/');
      if (slash == std::string::npos)
        return;
      path.resize(slash);
    }
  };
  consider(root, "");
  // A line is `number:controllers:path`; version 2 has no controllers.
  std::ifstream file(groups);
  for (std::string line; std::getline(file, line);) {
    size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos)
      continue;
    std::string names = line.substr(first + 1, second - first - 1);
    std::string path = line.substr(second + 1);
    if (names.empty())
      consider(root, path);
    else if (("," + names + ",").find(",cpu,") != std::string::npos)
      for (const std::string &mount : {root + "/cpu", root + "/" + names})
        consider(mount, path);
  }
  return least;
}

int warp::quotaOfOwnGroups() {
  return quotaOfControlGroups("/proc/self/cgroup", "/sys/fs/cgroup");
}

/// Threads that a variable asks for: the first number of `4` or `4,2`; 0
/// without one.
static size_t threadsFrom(const char *variable) {
  long number = std::strtol(environment(variable).c_str(), nullptr, 10);
  return number >= 1 ? std::min<long>(number, 1024) : 0;
}

std::vector<int> warp::choosePoolCpus() {
  std::vector<int> cpus;
  // Machines with more CPUs than a cpu_set_t holds need a larger mask.
  for (int limit = CPU_SETSIZE; limit <= 1 << 16 && cpus.empty(); limit *= 4) {
    cpu_set_t *set = CPU_ALLOC(limit);
    size_t bytes = CPU_ALLOC_SIZE(limit);
    if (sched_getaffinity(0, bytes, set) == 0)
      for (int i = 0; i < limit; ++i)
        if (CPU_ISSET_S(i, bytes, set))
          cpus.push_back(i < CPU_SETSIZE ? i : -1);
    CPU_FREE(set);
  }
  if (cpus.empty())
    cpus.push_back(-1);
  size_t wanted = std::min<size_t>(cpus.size(), quotaOfOwnGroups());
  if (size_t number = threadsFrom("WARP_NUM_THREADS"))
    wanted = number;
  else if (size_t number = threadsFrom("OMP_NUM_THREADS"))
    wanted = number;
  // More threads than CPUs, or fewer: let the scheduler place them.
  if (wanted != cpus.size())
    cpus.assign(wanted, -1);
  return cpus;
}
