//===- LaneCalls.h - Functions that lanes call ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A large function that stays one (Compiler/KeptCalls.h) is called once for all
// lanes: with the mask of those that come to the call, vectors for arguments
// that differ among them, scalars for others. There is such a variant of a
// function for each choice of arguments that differ, and within it control flow
// and accesses are those of a kernel's lanes.
//
// A row of an array that differs from lane to lane is passed as the array and
// indices of the row.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LANECALLS_H
#define WARP_LIB_TRANSFORMS_LANECALLS_H

#include "LaneCost.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include "llvm/ADT/StringMap.h"

#include <memory>
#include <string>
#include <vector>

namespace warp {

/// A function for one choice of arguments that differ.
struct LaneFunction {
  /// A copy for one lane, which `variance` is about.
  mlir::func::FuncOp scalar;
  std::unique_ptr<ThreadVariance> variance;
  LaneCost cost;
  /// The function for all lanes, once their number is known.
  mlir::func::FuncOp wide;
};

class LaneCalls {
public:
  explicit LaneCalls(mlir::FunctionOpInterface kernel) : kernel(kernel) {}

  /// Finds the functions that the kernel needs; why lanes cannot call one of
  /// them, or nothing. Calls that pass rows are changed.
  std::string find();
  /// The variance of the kernel, known by now.
  const ThreadVariance &getVariance() const { return *variance; }

  /// The function that lanes call; null where one call is for all of them.
  const LaneFunction *find(mlir::func::CallOp call) const {
    return calls.lookup(call);
  }
  /// Declares the functions for so many lanes.
  void declare(int64_t lanes);
  llvm::ArrayRef<std::unique_ptr<LaneFunction>> functions() const {
    return made;
  }
  /// Erases copies, and functions that are not called any more.
  void finish();

private:
  using MakeVariance = llvm::function_ref<std::unique_ptr<ThreadVariance>()>;

  std::string visit(mlir::FunctionOpInterface caller,
                    std::unique_ptr<ThreadVariance> &variance,
                    MakeVariance makeVariance);
  bool passRows(mlir::FunctionOpInterface caller,
                const ThreadVariance &variance);
  mlir::func::FuncOp withRows(mlir::func::CallOp call,
                              llvm::ArrayRef<unsigned> rows);
  std::string resolve(mlir::func::CallOp call, const ThreadVariance &variance);

  mlir::FunctionOpInterface kernel;
  std::unique_ptr<ThreadVariance> variance;
  /// Callees before callers, and their names with arguments.
  std::vector<std::unique_ptr<LaneFunction>> made;
  llvm::StringMap<LaneFunction *> byName;
  llvm::StringMap<mlir::func::FuncOp> rowFunctions;
  llvm::DenseMap<mlir::Operation *, const LaneFunction *> calls;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LANECALLS_H
