//===- SavedGraph.h - Graphs in files ---------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A graph that was captured with `traced` is saved with the code of its
// kernels and the contents of its memory, and replayed by a program that has
// neither the kernels' source nor Python. Arrays that the program is to read
// and write get names:
//
//   auto graph = warp::LoadedGraph::load("step.wrp", warp::cpuDevice);
//   graph->set("x", values.data(), values.size() * sizeof(float));
//   graph->launch();
//   graph->get("y", results.data(), results.size() * sizeof(float));
//
// Two things are written: the file, and beside it a folder, "step_modules",
// with a saved module (SavedModule.h) named by a hash of what is in it, so that
// an interrupted save leaves the former graph whole. The file, numbers
// little-endian, strings behind their length (64 bits):
//
//   magic "WARPGRPH" | format version (32 bits) | length of the payload
//   | hash of the payload | payload
//
// The payload is the release that wrote it, the target ("cpu", "sm_90"), the
// name and the hash of the saved module; blocks of memory with their contents
// where those matter; names with their place in a block; and the operations in
// order, with arguments as they lie in memory, but for pointers, of which there
// are the block and the place within it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SAVEDGRAPH_H
#define WARP_SAVEDGRAPH_H

#include "warp/Device.h"
#include "warp/Export.h"
#include "warp/Graph.h"
#include "warp/Launch.h"
#include "warp/Memory.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace warp {

/// A packed array of the graph's device under a name.
struct NamedMemory {
  std::string name;
  void *data = nullptr;
  size_t bytes = 0;
};

/// Files in memory.
struct GraphFiles {
  /// The graph's own file.
  std::string graph;
  /// The files in the folder beside it, by name; empty without launches.
  std::map<std::string, std::string> modules;
};

/// Contents of memory are those of now. Throws if the graph was not captured
/// with `traced`, or does what no file can hold: it names the operation.
WARP_API GraphFiles graphFiles(const Graph &graph,
                               const std::vector<NamedMemory> &names);
/// Writes them to `path`, which should end in ".wrp", and beside it; others see
/// the former graph or the new one.
WARP_API void saveGraph(const Graph &graph, const std::string &path,
                        const std::vector<NamedMemory> &names);

class WARP_API LoadedGraph {
public:
  /// Reads what `saveGraph` wrote. Throws if something is missing, damaged,
  /// from a release with another format, or made for another kind of device or
  /// a newer one, or if it needs more than `mostBytes` of memory. The CPU: this
  /// thread must not be capturing. No code of the file runs before the graph
  /// does; that code is machine code, so do not launch the graph of a stranger.
  static std::shared_ptr<LoadedGraph> load(const std::string &path, int device,
                                           uint64_t mostBytes = UINT64_MAX);
  /// `origin` is named in errors.
  static std::shared_ptr<LoadedGraph>
  fromFiles(const GraphFiles &files, int device, const std::string &origin,
            uint64_t mostBytes = UINT64_MAX);
  ~LoadedGraph();

  /// Work of the graph and access to its memory is queued on `stream`, or on
  /// the device's current one; on the CPU it is done on return.
  void launch(const Stream *stream = nullptr) { graph().launch(stream); }
  Graph &graph() const;
  int device() const { return graph().device(); }

  std::vector<std::string> names() const;
  bool has(const std::string &name) const;
  /// Memory of a name, which lives as long as this; throws if there is none.
  void *data(const std::string &name) const;
  size_t bytes(const std::string &name) const;
  /// Copy all of it from or to memory of a device; throws if sizes differ.
  void set(const std::string &name, const void *source, size_t bytes,
           int from = cpuDevice, const Stream *stream = nullptr);
  void get(const std::string &name, void *target, size_t bytes,
           int to = cpuDevice, const Stream *stream = nullptr) const;

private:
  struct Impl;
  explicit LoadedGraph(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl;
};

} // namespace warp

#endif // WARP_SAVEDGRAPH_H
