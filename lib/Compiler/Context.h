//===- Context.h - MLIR contexts and their locks ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One context serves the builders and compilations of a process. Its threading
// is off, so whoever touches IR holds the lock. Threads that compile beside the
// others have contexts of their own (`OwnContext`), to which a module gets as
// text. `Diagnostics` collects what MLIR reports while it lives and turns it
// into a `warp::Error` with the Python place that the op's location names.
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

#include <map>
#include <memory>
#include <mutex>

namespace mlir::func {
class FuncOp;
}

namespace warp {

/// A context, with the dialects that front-end IR uses loaded.
struct CompilerContext {
  CompilerContext();

  mlir::MLIRContext mlir;
  /// Held while IR is built, parsed, printed, transformed or destroyed.
  RecursiveForkMutex mutex;

  /// The pass managers of a kind, which belong to one context; made at the
  /// first use, with the lock held.
  template <class T> T &passes() {
    static const char kind = 0;
    if (auto found = kept.find(&kind); found != kept.end())
      return *static_cast<T *>(found->second.get());
    auto made = std::make_shared<T>();
    kept[&kind] = made;
    return *made;
  }

private:
  std::map<const void *, std::shared_ptr<void>> kept;
};

/// The context of this thread: that of the process, or its own.
CompilerContext &currentContext();
inline mlir::MLIRContext &compilerContext() { return currentContext().mlir; }
inline RecursiveForkMutex &contextMutex() { return currentContext().mutex; }

/// While it lives, this thread has a context that no other one uses. No module
/// of another context may be touched, and those made with it go before it.
class OwnContext {
public:
  OwnContext();
  ~OwnContext();
  OwnContext(const OwnContext &) = delete;
  OwnContext &operator=(const OwnContext &) = delete;

private:
  CompilerContext *previous;
};

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

/// The function of a module that has an attribute; null if none has it.
mlir::func::FuncOp findMarked(mlir::ModuleOp module, llvm::StringRef attribute);
/// The kernel of a module. Throws if there is none.
mlir::func::FuncOp kernelOf(mlir::ModuleOp module);

} // namespace warp

#endif // WARP_LIB_COMPILER_CONTEXT_H
