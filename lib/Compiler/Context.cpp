//===- Context.cpp - MLIR contexts and their locks ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Context.h"

#include "Apart.h"
#include "Pipelines.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

#include <utility>
#include <vector>

using namespace mlir;

static DialectRegistry makeRegistry() {
  DialectRegistry registry;
  warp::registerCompilerDialects(registry);
  return registry;
}

warp::CompilerContext::CompilerContext()
    : mlir(makeRegistry(), MLIRContext::Threading::DISABLED) {
  mlir.printOpOnDiagnostic(false);
  mlir.loadDialect<warp::WarpDialect, func::FuncDialect, scf::SCFDialect>();
}

static thread_local warp::CompilerContext *ownContext = nullptr;

warp::CompilerContext &warp::currentContext() {
  if (ownContext)
    return *ownContext;
  // It takes milliseconds to make.
  ForkSection section;
  // Never destroyed: handles in other static objects may outlive `main`.
  static auto *shared = new CompilerContext;
  return *shared;
}

namespace {
/// Contexts that no thread uses now. Never destroyed, like that of the process.
struct IdleContexts {
  warp::ForkMutex mutex;
  std::vector<warp::CompilerContext *> list;

  static IdleContexts &get() {
    static auto *contexts = new IdleContexts;
    return *contexts;
  }
};
} // namespace

warp::OwnContext::OwnContext() : previous(ownContext) {
  IdleContexts &idle = IdleContexts::get();
  {
    std::lock_guard lock(idle.mutex);
    if (!idle.list.empty()) {
      ownContext = idle.list.back();
      idle.list.pop_back();
      return;
    }
  }
  ownContext = new CompilerContext;
}

warp::OwnContext::~OwnContext() {
  IdleContexts &idle = IdleContexts::get();
  std::lock_guard lock(idle.mutex);
  idle.list.push_back(std::exchange(ownContext, previous));
}

warp::Apart::Apart() : context(std::make_unique<OwnContext>()) {}
warp::Apart::~Apart() = default;

FileLineColLoc warp::findSourceLocation(Location location) {
  FileLineColLoc found;
  location->walk([&](Location part) {
    found = dyn_cast<FileLineColLoc>(part);
    return found ? WalkResult::interrupt() : WalkResult::advance();
  });
  return found;
}

warp::Diagnostics::Diagnostics() : ScopedDiagnosticHandler(&compilerContext()) {
  setHandler([this](Diagnostic &diagnostic) {
    if (diagnostic.getSeverity() != DiagnosticSeverity::Error)
      return;
    std::string text = diagnostic.str();
    for (Diagnostic &note : diagnostic.getNotes()) {
      text += "\n  note: ";
      if (FileLineColLoc place = findSourceLocation(note.getLocation()))
        text += place.getFilename().str() + ":" +
                std::to_string(place.getLine()) + ": ";
      text += note.str();
    }
    if (!firstError.empty()) {
      // Equal reports of unrolled copies of a line are said once.
      text.insert(0, "\n");
      if (text != "\n" + firstError && rest.find(text) == std::string::npos)
        rest += text;
      return;
    }
    firstError = text;
    if (FileLineColLoc place = findSourceLocation(diagnostic.getLocation())) {
      file = place.getFilename().str();
      line = place.getLine();
      column = place.getColumn();
    }
  });
}

warp::Error warp::Diagnostics::toError(Error::Kind kind,
                                       const std::string &fallback) const {
  if (firstError.empty())
    return Error(kind, fallback);
  return Error(kind, firstError + rest, file, line, column);
}
