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
  underfilledFact = 2,
  skinnyFact = 4,
  innerExtentFact = 8,
  maxBlockCoarseningFact = 16,
  threadOrderFact = 32,
  allFacts = 63
};

} // namespace warp

#endif // WARP_SIZEFACTS_H
