//===- Files.cpp - Graphs on disk -----------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code of kernels has a name by its hash and is written first; the graph's own
// file, which says the name, is replaced in one step; then code that nobody
// names any more goes.
//
//===----------------------------------------------------------------------===//

#include "GraphFile.h"

#include "Runtime/Bytes.h"
#include "warp/SavedGraph.h"

#include <cerrno>
#include <cstring>
#include <filesystem>

using namespace warp;
using namespace warp::graphs;
namespace fs = std::filesystem;

/// "step_modules" for "step.wrp".
static fs::path folderOf(const std::string &path) {
  fs::path folder(path);
  if (folder.extension() == ".wrp")
    folder.replace_extension();
  return folder += "_modules";
}

void warp::saveGraph(const Graph &graph, const std::string &path,
                     const std::vector<NamedMemory> &names) {
  GraphFiles files = graphFiles(graph, names);
  fs::path folder = folderOf(path);
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed)
    throw format.error(path, "cannot be written: '" + folder.string() +
                                 "': " + failed.message());
  for (const auto &[name, bytes] : files.modules)
    format.replaceFile(folder / name, bytes);
  format.replaceFile(path, files.graph);
  for (const auto &entry : fs::directory_iterator(folder, failed)) {
    std::string name = entry.path().filename().string();
    if (name.rfind("kernels-", 0) == 0 && !files.modules.count(name))
      fs::remove(entry.path(), failed);
  }
}

std::shared_ptr<LoadedGraph> LoadedGraph::load(const std::string &path,
                                               int device, uint64_t mostBytes) {
  GraphFiles files;
  auto read = [&](const std::string &from) {
    errno = 0;
    std::optional<std::string> bytes = readFile(from);
    if (!bytes)
      throw format.error(path, "cannot be read: '" + from + "': " +
                                   std::strerror(errno ? errno : ENOENT));
    return std::move(*bytes);
  };
  files.graph = read(path);
  std::string module = GraphFile::fromBytes(files.graph, path).module;
  if (!module.empty())
    files.modules[module] = read((folderOf(path) / module).string());
  return fromFiles(files, device, path, mostBytes);
}
