//===- PoolCpus.cpp - CPUs of the thread pool -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As many threads as the process may use CPUs, less where a control group pays
// for fewer or WARP_NUM_THREADS asks for another number.
//
//===----------------------------------------------------------------------===//

#include "PoolCpus.h"

#include "Support.h"

#include <algorithm>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <sched.h>
#include <string>

using namespace warp;

/// CPUs that the control group's quota pays for; INT_MAX without one.
static int quotaOfControlGroup() {
  std::unique_ptr<FILE, int (*)(FILE *)> file(
      std::fopen("/sys/fs/cgroup/cpu.max", "r"), std::fclose);
  if (!file.get())
    return INT_MAX;
  long long quota = 0, period = 0;
  if (std::fscanf(file.get(), "%lld %lld", &quota, &period) != 2 ||
      quota <= 0 || period <= 0)
    return INT_MAX;
  return static_cast<int>(
      std::min<long long>(INT_MAX, (quota + period - 1) / period));
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
  size_t wanted = std::min<size_t>(cpus.size(), quotaOfControlGroup());
  std::string setting = environment("WARP_NUM_THREADS");
  if (!setting.empty()) {
    long number = std::strtol(setting.c_str(), nullptr, 10);
    if (number >= 1)
      wanted = std::min<long>(number, 1024);
  }
  // More threads than CPUs, or fewer: let the scheduler place them.
  if (wanted != cpus.size())
    cpus.assign(wanted, -1);
  return cpus;
}
