//===- Loader.h - Deserialisation of saved graphs ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GRAPHS_LOADER_H
#define WARP_LIB_GRAPHS_LOADER_H

#include "Geometry.h"
#include "Operations.h"

#include "warp/SavedGraph.h"
#include "warp/SavedModule.h"

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace warp {

struct LoadedGraph::Impl {
  graphs::GraphFile file;
  std::vector<std::shared_ptr<Kernel>> kernels;
  std::vector<std::unique_ptr<Buffer>> buffers;
  graphs::Geometry geometry;
  std::map<std::string, const graphs::FileName *> names;
  /// Goes first.
  std::shared_ptr<Graph> graph;

  char *startOf(uint32_t block) const {
    return static_cast<char *>(buffers[block]->data()) +
           file.blocks[block].lead;
  }
  const graphs::FileName &find(const std::string &name) const;
  const graphs::FileName &checked(const std::string &name, size_t bytes) const;
};

namespace graphs {

/// Makes a graph of a file that was read.
class Loader {
public:
  Loader(GraphFile &file, std::vector<std::shared_ptr<Kernel>> &kernels,
         std::vector<std::unique_ptr<Buffer>> &buffers, Geometry &geometry,
         int device, const std::string &origin)
      : file(file), kernels(kernels), buffers(buffers), geometry(geometry),
        device(device), origin(origin) {}

  void checkTarget() const;
  void loadKernels(const std::map<std::string, std::string> &modules);
  /// Throws unless all that operations reach is in the graph's memory, and all
  /// of that is reached by one. To be called before there is any.
  void checkReach();
  void checkRoom(uint64_t mostBytes) const;
  void allocate(const Stream *stream);
  void makeGeometry(const Stream *stream);
  void restorePointers();
  std::shared_ptr<Graph> capture(std::shared_ptr<Stream> stream);

private:
  Error damaged(const std::string &how) const {
    return format.error(origin, "is damaged, " + how);
  }
  void restorePointers(FileOperation &entry);
  FileOperation copyWithPointers(const FileOperation &entry);
  void checkDepth() const;
  void restorePointers(FileHandle &handle);
  void noteReach(uint32_t block, uint64_t end);
  void prepareGeometry();
  void writeGeometry();
  void writeIds(const std::vector<HandleWord> &words, std::string &bytes);
  void writeIds(const Stream *stream);
  uint64_t addressOf(uint32_t block, uint64_t offset) const;
  AddressRange rangeOf(uint32_t block) const;
  bool exists(uint32_t block) const {
    return block < file.blocks.size() + file.handles.size();
  }

  GraphFile &file;
  std::vector<std::shared_ptr<Kernel>> &kernels;
  std::vector<std::unique_ptr<Buffer>> &buffers;
  Geometry &geometry;
  SavedModule module;
  int device;
  const std::string &origin;
  /// The address at which all memory begins before there is any.
  static constexpr uint64_t nowhere = uint64_t(1) << 47;
  /// The targets of pointers that nothing is reached through.
  uint64_t spare = nowhere;
  bool isAllocated = false;
  /// Bytes of each block up to the last one that an operation reaches.
  std::vector<uint64_t> reach;
};

} // namespace graphs
} // namespace warp

#endif // WARP_LIB_GRAPHS_LOADER_H
