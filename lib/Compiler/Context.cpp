//===- Context.cpp - The process-wide MLIR context ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Context.h"

#include "Pipelines.h"

#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

MLIRContext &warp::compilerContext() {
  // It takes milliseconds to make.
  ForkSection section;
  // Never destroyed: handles in other static objects may outlive `main`.
  static MLIRContext *context = [] {
    DialectRegistry registry;
    warp::registerCompilerDialects(registry);
    auto *created = new MLIRContext(registry, MLIRContext::Threading::DISABLED);
    created->printOpOnDiagnostic(false);
    created
        ->loadDialect<warp::WarpDialect, func::FuncDialect, scf::SCFDialect>();
    return created;
  }();
  return *context;
}

warp::RecursiveForkMutex &warp::contextMutex() {
  static auto *mutex = new RecursiveForkMutex;
  return *mutex;
}

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
