//===- SumFunctions.h - Functions that add to exact sums --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_SUMFUNCTIONS_H
#define WARP_LIB_TRANSFORMS_SUMFUNCTIONS_H

#include "Targets/Target.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"

namespace warp {

/// The sums of an array, as a `SumDescriptor` has them, and one of its numbers.
struct SumPlace {
  mlir::Value digits, touched, count, number;
};

/// A window of digits: i64 for the weight of the second one, and the digits.
constexpr unsigned windowDigits(unsigned width) { return width == 32 ? 4 : 5; }
/// Weight of a window that has none yet.
constexpr int64_t emptyWindow = -2;

/// Calls of functions of a module that are made when they are first called.
/// `shared`: other threads may add at the same time.
class SumFunctions {
public:
  SumFunctions(mlir::ModuleOp module, const TargetInfo &target)
      : module(module), b(module.getContext()), scope(target.getLaunchScope()) {
  }

  /// Adds a float.
  void add(mlir::OpBuilder &caller, mlir::Location loc, const SumPlace &to,
           mlir::Value value, bool shared);
  /// Adds a float to a window, memory of the thread that has the digits of a
  /// few weights; what does not fit goes to the sum.
  void addToWindow(mlir::OpBuilder &caller, mlir::Location loc,
                   const SumPlace &to, mlir::Value value, mlir::Value window);
  /// Adds a digit, that other threads may add to.
  void addDigit(mlir::OpBuilder &caller, mlir::Location loc, const SumPlace &to,
                mlir::Value weight, mlir::Value digit, unsigned width);
  /// Adds a sum, that of floats of `width` bits.
  void addSum(mlir::OpBuilder &caller, mlir::Location loc, const SumPlace &to,
              mlir::Value digits, mlir::Value touched, unsigned width,
              bool shared);

private:
  using Body = llvm::function_ref<void(mlir::ValueRange)>;

  void call(mlir::OpBuilder &caller, mlir::Location loc, llvm::StringRef name,
            mlir::ValueRange operands, Body body);
  void buildAdd(mlir::ValueRange arguments, bool shared);
  void buildAddToWindow(mlir::ValueRange arguments);
  /// Takes a float apart, and gives the weight and digits of a finite one.
  void takeApart(mlir::Value value, const SumPlace &to,
                 llvm::function_ref<void(mlir::Value, mlir::ValueRange)> add);
  void buildAddSum(mlir::ValueRange arguments, unsigned width, bool shared);
  void mark(const SumPlace &to, mlir::Value weight, unsigned width);
  mlir::Value wordAt(const SumPlace &to, mlir::Value weight);
  void combine(const SumPlace &to, mlir::Value weight, mlir::Value digit,
               unsigned width, bool shared);
  void setFlags(const SumPlace &to, mlir::Value flags, unsigned width);
  mlir::SmallVector<mlir::Value> split(mlir::Value fraction,
                                       mlir::Value shift, unsigned count);
  mlir::Value constant(mlir::Type type, int64_t value);
  mlir::Value element(mlir::Type type, mlir::Value array, mlir::Value index);

  mlir::ModuleOp module;
  mlir::OpBuilder b;
  /// That of atomic updates.
  llvm::StringRef scope;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_SUMFUNCTIONS_H
