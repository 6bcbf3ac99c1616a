//===- LinkedObject.h - ELF object linked in memory -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_LOADER_LINKEDOBJECT_H
#define WARP_LIB_LOADER_LINKEDOBJECT_H

#include <cstddef>
#include <functional>
#include <map>
#include <string>
#include <string_view>

namespace warp {

/// A relocatable object of this processor in memory of its own; it is unmapped when
/// this goes.
class LinkedObject {
public:
  /// The address of a function outside, or null.
  using Find = std::function<void *(std::string_view)>;

  /// Throws an `Error` if the object is damaged, has a relocation that code of
  /// the compiler does not have, or asks for a function that is not found.
  LinkedObject(std::string_view bytes, const Find &find);
  ~LinkedObject();
  LinkedObject(const LinkedObject &) = delete;
  LinkedObject &operator=(const LinkedObject &) = delete;

  /// The address of what it defines for others, or null.
  void *symbol(std::string_view name) const;

private:
  friend class ObjectLinker;
  void *memory = nullptr;
  size_t size = 0;
  std::map<std::string, void *, std::less<>> symbols;
};

} // namespace warp

#endif // WARP_LIB_LOADER_LINKEDOBJECT_H
