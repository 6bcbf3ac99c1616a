//===- CalledFunctions.h - Memory effects of calls --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_CALLEDFUNCTIONS_H
#define WARP_LIB_ANALYSIS_CALLEDFUNCTIONS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include "llvm/ADT/SmallBitVector.h"
#include "llvm/ADT/StringMap.h"

namespace warp {

/// The memory that a function accesses, with all that it calls.
struct CallEffects {
  /// Arguments whose memory is read or written.
  llvm::SmallBitVector reads, writes;
  /// True for memory that is no argument's.
  bool readsOther = false, writesOther = false;

  bool mayWrite() const { return writesOther || writes.any(); }
};

/// The effects of the functions of a module, each found once.
class CalledFunctions {
public:
  CallEffects of(mlir::func::CallOp call);

private:
  CallEffects find(mlir::func::FuncOp function);

  llvm::StringMap<CallEffects> known;
};

} // namespace warp

#endif // WARP_LIB_ANALYSIS_CALLEDFUNCTIONS_H
