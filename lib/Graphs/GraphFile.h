//===- GraphFile.h - File format of saved graphs ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The contents of the file, apart from live memory and kernels; its format and
// its checks.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GRAPHS_GRAPHFILE_H
#define WARP_LIB_GRAPHS_GRAPHFILE_H

#include "Runtime/FileFormat.h"
#include "Runtime/GraphTrace.h"
#include "warp/Handle.h"

#include <string>
#include <vector>

namespace warp::graphs {

/// The version goes up when the file or the arguments of an operation change.
inline constexpr FileFormat format{"WARPGRPH", 4, "saved graph",
                                   "save it again"};

/// A handle in some bytes.
struct HandleWord {
  uint64_t at = 0;
  uint32_t handle = 0;
};

/// Memory that arrays of the graph lie in.
struct FileBlock {
  /// Bytes before it, for the sake of the alignment of what is in it.
  uint32_t lead = 0;
  uint64_t bytes = 0;
  /// All of it, or nothing where it is zero or written before it is read.
  std::string contents;
  std::vector<HandleWord> handles;
};

/// Geometry that kernels know by a number: its words, those that are addresses
/// as offsets within their blocks.
struct FileHandle {
  uint8_t kind = 0;
  std::array<uint64_t, handleWords> words{};
  /// For each address (`pointerWords`).
  std::vector<uint32_t> blocks;
};

struct FileName {
  std::string name;
  uint32_t block = 0;
  uint64_t offset = 0, bytes = 0;
};

/// Blocks of pointers that lead to none: null, and such that nothing is
/// reached through. Numbers behind those of blocks are words of handles.
inline constexpr uint32_t nullBlock = 0xffffffff, spareBlock = 0xfffffffe;

struct FileOperation {
  /// Pointers among the arguments are offsets within their blocks.
  GraphOperation operation;
  std::vector<uint32_t> blocks;
  /// Among the arguments, and in the constant.
  std::vector<HandleWord> handles, constantHandles;
  uint32_t kernel = 0;
  /// GPU: threads of a block, 0 if the launch left it open.
  int32_t blockDim = 0;
};

struct GraphFile {
  /// "cpu" or "sm_90".
  std::string target;
  /// File of the kernels in the folder, and its hash; empty without launches.
  std::string module;
  uint64_t moduleHash = 0;
  std::vector<FileBlock> blocks;
  std::vector<FileHandle> handles;
  std::vector<FileName> names;
  std::vector<FileOperation> operations;

  std::string bytes() const;
  /// Throws if it is no such file, has another format or is damaged.
  static GraphFile fromBytes(const std::string &bytes,
                             const std::string &origin);
};

} // namespace warp::graphs

#endif // WARP_LIB_GRAPHS_GRAPHFILE_H
