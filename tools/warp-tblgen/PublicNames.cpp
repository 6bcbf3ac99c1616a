//===- PublicNames.cpp - The imports of the package's file ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Reads `from module import attribute as name` of `warp/__init__.py`, with or
// without parentheses. Imports under `if TYPE_CHECKING:` are lazy.
//
//===----------------------------------------------------------------------===//

#include "Records.h"

#include "llvm/Support/CommandLine.h"
#include "llvm/Support/MemoryBuffer.h"
#include "llvm/TableGen/Error.h"

using namespace llvm;
using namespace warp::tblgen;

static cl::opt<std::string>
    publicNames("public-names",
                cl::desc("The package's __init__.py, whose imports are public "
                         "names for -gen-pyi and -gen-python-table"),
                cl::value_desc("file"));

std::vector<PublicName> warp::tblgen::readPublicNames() {
  std::vector<PublicName> names;
  if (publicNames.empty())
    return names;
  auto buffer = MemoryBuffer::getFile(publicNames);
  if (!buffer)
    PrintFatalError("can't read '" + publicNames +
                    "': " + buffer.getError().message());
  SmallVector<StringRef> lines;
  (*buffer)->getBuffer().split(lines, '\n');
  StringRef module;
  bool isLazy = false, isList = false;
  for (StringRef line : lines) {
    StringRef imports = line.trim();
    if (imports.starts_with("from warp")) {
      isLazy = line.starts_with(" ");
      std::tie(module, imports) = imports.split(" import ");
      module.consume_front("from ");
      isList = imports.consume_front("(");
    } else if (!isList) {
      continue;
    }
    if (imports.consume_back(")"))
      isList = false;
    auto [attribute, name] = imports.rtrim(',').split(" as ");
    if (!name.empty() && name[0] != '_')
      names.push_back({name.str(), module.str(), attribute.str(), isLazy});
  }
  return names;
}
