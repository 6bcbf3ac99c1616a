//===- Geometry.h - Geometry of graphs in files -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A file has the words that a handle leads to and the memory behind them, as
// any other memory, so it does not matter who built what is there. Where the
// graph has the host build or refit on the CPU, objects are made for that.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GRAPHS_GEOMETRY_H
#define WARP_LIB_GRAPHS_GEOMETRY_H

#include "GraphFile.h"

#include "Runtime/Overlap.h"
#include "warp/Bvh.h"
#include "warp/HashGrid.h"
#include "warp/Mesh.h"

#include <map>
#include <memory>
#include <optional>
#include <variant>

namespace warp::graphs {

/// Geometry whose handles a graph has that is saved.
class FoundHandles {
public:
  explicit FoundHandles(int device) : device(device) {}

  /// The number of the geometry, if a word is the handle of one. Throws if it
  /// was one, or is one of another device; `where` names the operation.
  std::optional<uint32_t> find(uint64_t word, const std::string &where);
  /// The number of the geometry in whose words memory lies.
  std::optional<uint32_t> around(const AddressRange &range) const;

  const std::vector<HandleContents> &all() const { return contents; }
  uint64_t addressOf(uint32_t number) const { return addresses[number]; }

private:
  int device;
  std::map<uint64_t, uint32_t> numbers;
  std::vector<HandleContents> contents;
  std::vector<uint64_t> addresses;
};

/// Geometry of a graph that was loaded.
class Geometry {
public:
  /// Gives every handle of the file an object; words come later.
  void make(const GraphFile &file, int device);
  /// An object that the graph updates; its arrays are where they will be.
  void prepare(uint32_t number, const FileHandle &handle,
               const UpdateGeometry &update);
  void write(uint32_t number, const std::array<uint64_t, handleWords> &words);

  uint64_t id(uint32_t number) const;
  uint64_t address(uint32_t number) const { return handleAddress(id(number)); }

  void update(const UpdateGeometry &update) const;

private:
  using Object =
      std::variant<std::unique_ptr<GeometryHandle>, std::unique_ptr<Bvh>,
                   std::unique_ptr<Mesh>, std::unique_ptr<HashGrid>>;
  std::vector<Object> objects;
  int device = 0;
};

} // namespace warp::graphs

#endif // WARP_LIB_GRAPHS_GEOMETRY_H
