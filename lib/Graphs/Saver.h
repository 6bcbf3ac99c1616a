//===- Saver.h - State of graph serialisation -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GRAPHS_SAVER_H
#define WARP_LIB_GRAPHS_SAVER_H

#include "Geometry.h"
#include "GraphFile.h"
#include "Operations.h"

#include "warp/Error.h"
#include "warp/SavedGraph.h"
#include "warp/SavedModule.h"

#include <set>
#include <string>
#include <vector>

namespace warp::graphs {

struct Block {
  AddressRange range;
  /// True if the contents matter, once that is known.
  bool touched = false, needed = false;
  /// Geometry leads there, and does not always say how far.
  bool ofGeometry = false;
};

class Saver {
public:
  Saver(const Graph &graph, const std::vector<NamedMemory> &names)
      : device(graph.device()), operations(graph.trace()->operations),
        names(names), handles(graph.device()) {}

  GraphFiles save();

private:
  void collectKernels();
  void checkKernel(const Kernel &kernel, const SavedKernel &saved) const;
  void findHandles(size_t number);
  void findIdArrays(size_t number, const std::set<size_t> &arrays);
  void followCopies();
  void collectMemory();
  void chooseContents();
  uint32_t blockOf(const AddressRange &range) const;
  uint64_t startOf(uint32_t block) const;
  void readBlocks();
  void addHandles();
  std::vector<HandleWord> idsIn(const AddressRange &range, std::string &bytes);
  FileOperation fileOperation(size_t number);
  void addNames();

  int device;
  const std::vector<GraphOperation> &operations;
  const std::vector<NamedMemory> &names;

  SavedModule module;
  /// For each operation that is a launch.
  std::vector<uint32_t> kernels;
  std::vector<std::vector<Pointer>> pointers;
  FoundHandles handles;
  /// For each operation, among its arguments.
  std::vector<std::vector<HandleWord>> handleWords;
  /// Memory with elements that may be handles, and who has it.
  std::vector<std::pair<AddressRange, std::string>> idArrays;
  std::vector<Block> blocks;
  GraphFile file;
};

inline Error saveError(Error::Kind kind, const std::string &problem) {
  return Error(kind, "cannot save the graph: " + problem);
}

} // namespace warp::graphs

#endif // WARP_LIB_GRAPHS_SAVER_H
