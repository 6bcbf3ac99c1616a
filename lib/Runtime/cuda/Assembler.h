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

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace warp {

/// Bytes of PTX from which others had better not wait for the assembler.
constexpr size_t longProgram = 100'000;

struct AssembledProgram {
  std::vector<char> binary;
  /// It is as good as what the driver makes: by a program of its release.
  bool isBest = false;
};

/// True if there is a program that does not fail, of the driver's release.
/// mayBeWorse: or of another one.
bool hasAssembler(bool mayBeWorse);

/// Machine code by `ptxas`, whose end the caller waits for. Nothing if there is
/// no program that the driver goes with, if it fails, or if the work of this
/// thread is abandoned.
/// target: "sm_90a".
/// mayBeWorse: also by one of another release than the driver's, and long
/// programs with less effort.
std::optional<AssembledProgram>
assembleApart(std::string_view ptx, const std::string &target, bool mayBeWorse);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_ASSEMBLER_H
