//===- Abandon.h - Cancellation of compilations -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_ABANDON_H
#define WARP_LIB_COMPILER_ABANDON_H

#include <atomic>

namespace warp {

/// While it lives, a compilation by this thread throws an `Error` at its next
/// step once the flag is set. Generating code is one step.
class Abandonable {
public:
  explicit Abandonable(const std::atomic<bool> &flag);
  ~Abandonable();
};

/// True if the flag of this thread's `Abandonable` is set.
bool isAbandoned();

} // namespace warp

#endif // WARP_LIB_COMPILER_ABANDON_H
