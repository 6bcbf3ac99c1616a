//===- KernelClaim.h - Claim of one process to compile an entry -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Processes that start together ask a cold cache for the same kernels. The
// first to miss an entry creates `<key>.claim` beside it; others wait until
// that file is gone and read the entry. They wait for ten seconds at most, and
// only while the claiming process lives, or for two if it is on another host,
// so a killed or a slow process costs others time and never their result. A
// process that has compiled nothing yet and has just waited lets others claim
// first, for some milliseconds.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_KERNELCLAIM_H
#define WARP_LIB_RUNTIME_KERNELCLAIM_H

#include <chrono>
#include <string>

namespace warp {

inline constexpr const char *claimSuffix = ".claim";

class KernelClaim {
public:
  /// Claims an entry of the process's cache, or waits for another process.
  explicit KernelClaim(const std::string &key);
  ~KernelClaim();
  KernelClaim(const KernelClaim &) = delete;
  KernelClaim &operator=(const KernelClaim &) = delete;

  /// True if another process had the claim: the entry may be there now.
  bool hasWaited() const { return waited; }

  /// As if this process had compiled nothing yet, for tests.
  static void forgetWork();

private:
  /// Empty if this process has no claim.
  std::string file;
  std::chrono::steady_clock::time_point begin;
  bool waited = false;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_KERNELCLAIM_H
