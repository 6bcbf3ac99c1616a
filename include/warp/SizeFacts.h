//===- SizeFacts.h - Facts about a launch's size ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SIZEFACTS_H
#define WARP_SIZEFACTS_H

namespace warp {

/// Bits of a mask; `CompileOptions` explains each.
enum SizeFact : int {
  largeFact = 1,
  underFact = 2,
  narrowFact = 4,
  rowFact = 8,
  joinableFact = 16,
  /// `CompileOptions::ordered`, where nothing is deterministic.
  turnFact = 32,
  allFacts = 63
};

} // namespace warp

#endif // WARP_SIZEFACTS_H
