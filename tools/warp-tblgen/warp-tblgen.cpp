//===- warp-tblgen.cpp - Back ends of the registry ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Writes, from the TableGen records of the builtins, what else depends on
// them: the C++ tables, the front end's table, the stubs, the reference.
//
//===----------------------------------------------------------------------===//

#include "llvm/Support/CommandLine.h"
#include "llvm/Support/InitLLVM.h"
#include "llvm/TableGen/Main.h"

int main(int argc, char **argv) {
  llvm::InitLLVM init(argc, argv);
  llvm::cl::ParseCommandLineOptions(argc, argv);
  return llvm::TableGenMain(argv[0], llvm::TableGenMainFn());
}
