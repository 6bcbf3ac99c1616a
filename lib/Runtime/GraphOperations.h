//===- GraphOperations.h - Arguments of captured operations -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHOPERATIONS_H
#define WARP_LIB_RUNTIME_GRAPHOPERATIONS_H

#include "GraphTrace.h"
#include "Overlap.h"

#include <string>
#include <vector>

namespace warp::graphs {

/// A pointer among the arguments, at byte `slot`, and the memory that the
/// operation reaches through it: none if the range is empty.
struct Pointer {
  size_t slot;
  AddressRange range;
};

/// All pointers of an operation, in the order of their slots. `accesses` are
/// those of a launch's kernel. Throws if the arguments make no sense.
std::vector<Pointer> pointersOf(const GraphOperation &operation,
                                const std::vector<Access> &accesses);

/// Only where they are, which depends on no pointer.
std::vector<size_t> slotsOf(const GraphOperation &operation,
                            const std::vector<Access> &accesses);

/// The name in error messages: "launch of 'saxpy'".
std::string describe(const GraphOperation &operation);

/// The error about arguments that no program has written.
Error nonsense(const GraphOperation &operation);

/// Throws `Error` of kind `Value` unless an operation that was read from a file
/// has arguments of the right size; a launch has `parameterSize` bytes.
void checkArguments(const GraphOperation &operation, size_t parameterSize);

} // namespace warp::graphs

#endif // WARP_LIB_RUNTIME_GRAPHOPERATIONS_H
