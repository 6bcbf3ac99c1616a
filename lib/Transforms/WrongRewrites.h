//===- WrongRewrites.h - Disabled rewrites of LLVM --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_WRONGREWRITES_H
#define WARP_LIB_TRANSFORMS_WRONGREWRITES_H

#include "mlir/IR/PatternMatch.h"

#include "llvm/ADT/SmallVector.h"

#include <string>

namespace warp {

/// Names of canonicalizations that give wrong code, for whoever runs those of
/// other dialects. LLVM 22 moves a branch that ends the condition of a loop
/// into its body, and gets it wrong where the condition forwards one result of
/// it twice.
inline llvm::SmallVector<std::string> wrongRewrites() {
  return {"(anonymous namespace)::WhileMoveIfDown"};
}

/// Adds what takes their place. Loops over the neighbours of a point have the
/// form that `findRuns` knows only if such a branch moves.
void addRightRewrites(mlir::RewritePatternSet &patterns);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_WRONGREWRITES_H
