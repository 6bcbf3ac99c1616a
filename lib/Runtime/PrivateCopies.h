//===- PrivateCopies.h - Launches on privatized arrays ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// How a launch that updates arrays without atomic instructions is shared: each
// worker but the first gets a parameter block whose pointers lead to copies of
// its own, and the copies are combined with the arrays afterwards. Which sums a
// float ends up in then depends on who took which chunk.
//
// Whoever is in here holds the update gate alone (cpu/Kernel.cpp), so there is
// one piece of memory for the copies of all kernels. Between launches it holds
// zeros: adding a copy to its array clears it, and only where it was touched. A
// worker fills copies for minima and maxima with what changes nothing when its
// first chunk comes; they are cleared as a whole.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_PRIVATECOPIES_H
#define WARP_LIB_RUNTIME_PRIVATECOPIES_H

#include "warp/Launch.h"
#include "warp/PrivateCopies.h"

#include <cstddef>

namespace warp {

/// How a launch updates elements.
enum class UpdateMode {
  /// One thread, plainly.
  Alone,
  /// Several threads, plainly, with copies.
  Copies,
  /// Several threads, atomically: by other code.
  Atomic,
};

/// The quickest mode, by estimates of the compiler and the arrays' sizes.
UpdateMode chooseUpdates(const CopiedArrays &copied, const void *params,
                         int64_t items);

/// The copies of one launch.
class PrivateCopies {
public:
  PrivateCopies(const CopiedArrays &copied, const void *params,
                size_t paramSize);
  ~PrivateCopies();
  PrivateCopies(const PrivateCopies &) = delete;
  PrivateCopies &operator=(const PrivateCopies &) = delete;

  /// The parameter block of a worker of the pool, which calls this.
  const void *paramsOf(int worker);
  /// Combines the copies with the arrays, once no worker is inside.
  void merge();

private:
  struct Array {
    void *data;
    int64_t numbers, width, floating, isUnsigned;
    CopyKind kind;
    /// Its start in the memory of a worker.
    size_t offset;
  };
  struct alignas(64) Worker {
    bool isUsed = false;
  };

  template <typename T>
  void mergeArray(const Array &array, const std::vector<char *> &copies);
  void fillCopies(int worker);

  const void *params;
  size_t paramSize;
  std::vector<Array> arrays;
  std::vector<Worker> workers;
  /// Parameter blocks of all workers but the first.
  std::vector<uint64_t> blocks;
  /// Memory of the second worker; bytes of each.
  char *memory = nullptr;
  size_t bytes = 0;
  bool isClear = false;
};

/// Gives memory of copies back that no launch has used for a while.
void freeIdleCopies();

/// Forgets the copies of a parent process.
void forgetCopiesInChild();

} // namespace warp

#endif // WARP_LIB_RUNTIME_PRIVATECOPIES_H
