//===- Assembler.h - PTX assembly by the toolkit's ptxas --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The driver assembles whole programs one after the other, however many threads
// ask it. `ptxas` of a CUDA toolkit is a program: as many work at a time as
// there are processors, and what they make is a whole program, too, which the
// kernel cache can keep. Where no such program is installed, nothing changes.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_ASSEMBLER_H
#define WARP_LIB_RUNTIME_CUDA_ASSEMBLER_H

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace warp {

struct AssembledProgram {
  std::vector<char> binary;
  /// The program is of the driver's own release, whose code is as good as that
  /// of the driver.
  bool isDriversRelease = false;
};

/// Machine code by `ptxas`, whose end the caller waits for. Nothing if there is
/// no program that the driver goes with, if it fails, or if the work of this
/// thread is abandoned.
/// target: "sm_90a".
/// anyRelease: also by one of another release than the driver's.
std::optional<AssembledProgram> assembleApart(std::string_view ptx,
                                              const std::string &target,
                                              bool anyRelease);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_ASSEMBLER_H
