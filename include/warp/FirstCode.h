//===- FirstCode.h - Tier-0 code for first launches -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_FIRSTCODE_H
#define WARP_FIRSTCODE_H

#include "warp/Compile.h"

#include <cstdint>

namespace warp {

/// The level of `CompileOptions::optLevel` that takes least time to compile.
constexpr int quickLevel = 0;
/// Stands for launches of any number of threads, which have the best code.
constexpr int64_t anyItems = INT64_MAX;

struct FirstCode {
  Code code;
  /// It is what `quickOptions` give.
  bool isQuick = false;
};

/// The options of code that is there quickly: on CPUs little of it is
/// optimised, on GPUs it calls the machine code of the device library.
WARP_API CompileOptions quickOptions(CompileOptions wanted);

/// True if code quickly compiled for a CPU does for a launch of so many
/// threads: it computes the same bits, and the launch has little work, or the
/// code is so long that compiling it well takes longer than most of its
/// launches, whatever its loops may cost. Where threads share the launch, they
/// go over to tier-1 code as soon as it is there.
WARP_API bool isQuickEnough(const Code &code, int64_t items);

/// Compiles a variant quickly if that does for a launch of so many threads, and
/// with the effort that the options ask for otherwise. Both compute the same
/// bits, but for the sign and payload of NaNs: what may be computed in another
/// order, as with `fastMath`, is never compiled quickly. On GPUs it does for
/// all launches of kernels that call a long function of the device library.
WARP_API FirstCode compileFirst(const Module &module,
                                const CompileOptions &options, int64_t items);

} // namespace warp

#endif // WARP_FIRSTCODE_H
