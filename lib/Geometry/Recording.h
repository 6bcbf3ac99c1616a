//===- Recording.h - Geometry in graphs of the CPU --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_RECORDING_H
#define WARP_LIB_GEOMETRY_RECORDING_H

#include "Slots.h"

#include "Runtime/GraphImpl.h"
#include "warp/Bvh.h"

#include <initializer_list>

namespace warp::geometry {

/// The note of an update of an object with those arrays.
inline graphs::UpdateGeometry
noteOf(const Slot &slot, std::initializer_list<ArrayDescriptor> arrays) {
  graphs::UpdateGeometry note{};
  note.handle = slot.id();
  note.kind = int32_t(slot.kind());
  size_t i = 0;
  for (const ArrayDescriptor &array : arrays)
    note.arrays[i++] = array;
  return note;
}

inline graphs::UpdateGeometry rebuildOf(graphs::UpdateGeometry note,
                                        BvhConstructor constructor) {
  note.rebuilds = 1;
  note.constructor = int32_t(constructor);
  return note;
}

/// Does an update now, or when the graph runs that this thread records.
template <class Fn>
void update(const Slot &slot, const graphs::UpdateGeometry &note, Fn &&run) {
  if (!isHost(slot.device()))
    return run();
  TraceScope tracing(slot.device(), nullptr);
  if (tracing)
    tracing->add(GraphOperation::Kind::UpdateGeometry, note);
  // Nobody knows how long it takes; it is not short.
  if (!recordOnHost(size_t(1) << 30, run))
    run();
}

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_RECORDING_H
