//===- Context.h - The process-wide MLIR context ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One context serves every builder and every compilation of a process. Its
// threading is off, so whoever touches IR holds the lock. `Diagnostics`
// collects what MLIR reports while it lives and turns it into a
// `warp::Error` with the Python place that the op's location names.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_CONTEXT_H
#define WARP_LIB_COMPILER_CONTEXT_H

#include "warp/Builder.h"
#include "warp/Forks.h"

#include "mlir/IR/BuiltinOps.h"
#include "mlir/IR/Diagnostics.h"
#include "mlir/IR/MLIRContext.h"
#include "mlir/IR/OwningOpRef.h"

#include <mutex>

namespace warp {

/// The context, with the dialects that front-end IR uses loaded.
mlir::MLIRContext &compilerContext();

/// Held while IR is built, parsed, printed, transformed or destroyed.
RecursiveForkMutex &contextMutex();

struct ContextLock {
  ContextLock() : guard(contextMutex()) {}
  std::lock_guard<RecursiveForkMutex> guard;
};

/// Collects the diagnostics of one operation on IR.
class Diagnostics : mlir::ScopedDiagnosticHandler {
public:
  Diagnostics();
  /// Everything reported so far, notes indented, as an error of that kind at
  /// the first error's place; `fallback` if nothing was reported.
  Error toError(Error::Kind kind, const std::string &fallback) const;

private:
  std::string firstError, rest, file;
  int line = 0, column = 0;
};

/// File, line and column that a location names, looking through call sites,
/// names and fused locations.
mlir::FileLineColLoc findSourceLocation(mlir::Location location);

struct Module::Impl {
  mlir::OwningOpRef<mlir::ModuleOp> op;
  ~Impl() {
    ContextLock lock;
    op = nullptr;
  }
};

} // namespace warp

#endif // WARP_LIB_COMPILER_CONTEXT_H
