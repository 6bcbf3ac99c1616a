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

/// Words of memory that may be ids: `first`, and more at every multiple of
/// `step` from there, before the end of the range.
struct IdArray {
  AddressRange range;
  uint64_t first, step;
  /// The operation that has them.
  std::string where;
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
  void findUpdated(size_t number);
  void findIds();
  bool followLaunch(size_t number);
  bool followCopy(size_t number);
  bool addIdArray(IdArray array);
  bool mayHaveIds(const AddressRange &range, uint64_t first,
                  uint64_t step) const;
  void collectMemory();
  void chooseContents();
  uint32_t blockOf(const AddressRange &range) const;
  uint64_t startOf(uint32_t block) const;
  void readBlocks();
  void addHandles();
  void takeId(std::string &bytes, uint64_t at, const std::string &where,
              std::vector<HandleWord> &words);
  std::vector<HandleWord> idsIn(const AddressRange &range, std::string &bytes);
  std::vector<HandleWord> idsOfFill(size_t number, std::string &pattern);
  std::vector<HandleWord> idsOfConstant(size_t number, std::string &constant);
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
  std::vector<IdArray> idArrays;
  std::vector<Block> blocks;
  GraphFile file;
};

inline Error saveError(Error::Kind kind, const std::string &problem) {
  return Error(kind, "cannot save the graph: " + problem);
}

} // namespace warp::graphs

#endif // WARP_LIB_GRAPHS_SAVER_H
