//===- FunctionKernel.h - Functions as kernels and back ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_FUNCTIONKERNEL_H
#define WARP_TRANSFORMS_AUTODIFF_FUNCTIONKERNEL_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp {

/// Floats and composites of floats.
bool hasDifferential(mlir::Type type);

/// `name` with a suffix, made different from all symbols of the module.
std::string freshName(mlir::ModuleOp module, llvm::StringRef name,
                      llvm::StringRef suffix);

/// A kernel around a function, with an array of one element for each argument
/// and result that has a differential:
///
///   x = load X[0]; ...; y = call @f(x, ...); store y, Y[0]
///
/// Its derivative becomes a function again, in which the elements of X and Y,
/// of their gradients and of their tangents are values.
class FunctionKernel {
public:
  /// Adds the kernel to the module of the function.
  explicit FunctionKernel(mlir::func::FuncOp function);

  /// Adds to `module` what the adjoint or the dual of the kernel has become:
  ///   reverse: (arguments, cotangents of results) -> cotangents of arguments
  ///   forward: (arguments, tangents of arguments) -> tangents of results
  mlir::FailureOr<mlir::func::FuncOp>
  toFunction(mlir::func::FuncOp derivative, mlir::ModuleOp module,
             bool forward);

private:
  /// The meaning of an array of the kernel.
  struct Box {
    unsigned position;
    mlir::Type type;
    bool isResult;
    /// For the derivative: the value, and its cotangent or tangent if that is
    /// passed.
    mlir::Value value, seed;
  };

  mlir::LogicalResult replaceDifferential(Box &box,
                                          mlir::func::FuncOp derivative,
                                          bool forward);
  mlir::FailureOr<mlir::Value>
  promote(llvm::ArrayRef<mlir::Value> arrays, mlir::Value initial);
  mlir::func::FuncOp move(mlir::func::FuncOp derivative,
                          mlir::ModuleOp module, bool forward);
  mlir::LogicalResult fail(mlir::Operation *op);

  std::string name;
  llvm::SmallVector<mlir::Type> argumentTypes;
  llvm::SmallVector<Box> boxes;
};

} // namespace warp

#endif // WARP_TRANSFORMS_AUTODIFF_FUNCTIONKERNEL_H
