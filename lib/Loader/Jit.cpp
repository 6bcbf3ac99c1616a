//===- Jit.cpp - Loads CPU objects without LLVM ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The counterpart of lib/Compiler/Jit.cpp for libwarp_runtime.so.
//
//===----------------------------------------------------------------------===//

#include "LinkedObject.h"

#include "Support/LibraryObjects.h"
#include "Support/RuntimeSymbols.h"

#include "warp/Compile.h"
#include "warp/Forks.h"

#include <map>
#include <memory>
#include <mutex>

using namespace warp;

struct warp::Jit::Impl {
  Impl() {
    for (RuntimeSymbol symbol : runtimeSymbols())
      known[symbol.name] = symbol.address;
  }

  void *findKnown(std::string_view name) const {
    auto found = known.find(name);
    return found == known.end() ? nullptr : found->second;
  }

  /// A function of the process, or `warp_mesh_ray.v4` of the device library.
  void *find(std::string_view name) {
    if (void *address = findKnown(name))
      return address;
    size_t dot = name.rfind('.');
    if (dot == name.npos)
      return nullptr;
    for (const LibraryObject &object : libraryObjects()) {
      if (object.level != name.substr(dot + 1))
        continue;
      std::unique_ptr<LinkedObject> &library = libraries[object.level];
      if (!library)
        library = std::make_unique<LinkedObject>(
            object.bytes,
            [&](std::string_view other) { return findKnown(other); });
      return library->symbol(name.substr(0, dot));
    }
    return nullptr;
  }

  ForkMutex mutex;
  std::map<std::string, void *, std::less<>> known;
  std::map<std::string_view, std::unique_ptr<LinkedObject>> libraries;
  std::map<void *, std::unique_ptr<LinkedObject>> loaded;
};

warp::Jit::Jit() : impl(new Impl) {}

warp::Jit &warp::Jit::get() {
  // Never destroyed: kernels may run while the process exits.
  static auto *jit = new Jit;
  return *jit;
}

void *warp::Jit::load(const Code &code) {
  std::lock_guard guard(impl->mutex);
  auto object = std::make_unique<LinkedObject>(
      std::string_view(code.binary.data(), code.binary.size()),
      [&](std::string_view name) { return impl->find(name); });
  void *entry = object->symbol(code.entry);
  if (!entry)
    throw Error(Error::Kind::Compile,
                "cannot load compiled code: it has no '" + code.entry + "'");
  impl->loaded[entry] = std::move(object);
  return entry;
}

void warp::Jit::unload(void *entry) {
  std::lock_guard guard(impl->mutex);
  impl->loaded.erase(entry);
}
