//===- BuilderImpl.h - State of a kernel builder ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_BUILDERIMPL_H
#define WARP_LIB_COMPILER_BUILDERIMPL_H

#include "Context.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"

#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/StringMap.h"

namespace warp {

inline Type wrap(mlir::Type type) { return {type.getAsOpaquePointer()}; }
inline Value wrap(mlir::Value value) { return {value.getAsOpaquePointer()}; }
inline mlir::Type unwrap(Type type) {
  return mlir::Type::getFromOpaquePointer(type.impl);
}
inline mlir::Value unwrap(Value value) {
  return mlir::Value::getFromOpaquePointer(value.impl);
}
Builder::Values wrap(mlir::ValueRange values);
llvm::SmallVector<mlir::Value, 4> unwrap(const Builder::Values &values);

struct Builder::Impl {
  using Inits = llvm::SmallVector<mlir::Value, 4>;

  /// An open loop. Values carried from the start lie in the operation; those
  /// added by `carry` are collected here until it closes.
  struct Loop {
    mlir::Operation *op = nullptr;
    Inits lateInits;
    bool isFor = false;
  };

  /// A function under construction.
  struct Function {
    mlir::func::FuncOp op;
    llvm::SmallVector<mlir::scf::IfOp, 4> ifs;
    llvm::SmallVector<Loop, 4> loops;
    /// Scalar constants and zeros; they stand at the start of the entry block.
    llvm::DenseMap<mlir::Attribute, mlir::Value> constants;
    llvm::DenseMap<mlir::Type, mlir::Value> zeros;
    mlir::Operation *lastConstant = nullptr;
    mlir::OpBuilder::InsertPoint caller;
  };

  explicit Impl(const std::string &name);
  ~Impl();

  Function &function();
  Loop &innermostLoop(bool isFor);
  mlir::Value constant(mlir::TypedAttr value);
  mlir::Value constantI32(int64_t value);
  mlir::Value zero(mlir::Type type);
  /// Inserts at the start of the entry block, after earlier constants.
  template <typename Create> mlir::Value hoist(Create create);
  /// The operation's results, folded if all operands are constants.
  llvm::SmallVector<mlir::Value, 2> fold(mlir::Operation *op);
  [[noreturn]] void fail(Error::Kind kind, const std::string &message) const;
  [[noreturn]] void failType(const std::string &message) const {
    fail(Error::Kind::Type, message);
  }


  mlir::OpBuilder builder;
  mlir::OwningOpRef<mlir::ModuleOp> module;
  mlir::Location loc;
  std::string file;
  int line = 0, column = 0;
  llvm::SmallVector<Function, 2> functions;
  llvm::StringMap<mlir::func::FuncOp> finished;
};

/// The scalar attribute for a number, or null if it does not fit.
mlir::TypedAttr numberAttr(mlir::Type type, const Number &number);
/// Type of a composite's component or row; constant indices are checked.
mlir::Type checkedPart(Builder::Impl &impl, mlir::Type composite,
                       mlir::ValueRange indices);
/// "'int32' and 'float32'" of values' types.
std::string quotedTypes(mlir::TypeRange types);
inline std::string quoted(mlir::Type type) {
  return "'" + getPythonName(type) + "'";
}

template <typename Create> mlir::Value Builder::Impl::hoist(Create create) {
  Function &current = function();
  mlir::OpBuilder::InsertionGuard guard(builder);
  if (current.lastConstant)
    builder.setInsertionPointAfter(current.lastConstant);
  else
    builder.setInsertionPointToStart(&current.op.front());
  mlir::Value made = create();
  current.lastConstant = made.getDefiningOp();
  return made;
}

} // namespace warp

#endif // WARP_LIB_COMPILER_BUILDERIMPL_H
