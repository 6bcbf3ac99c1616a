//===- XlaCall.h - Shared parts of calls from XLA ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_XLACALL_H
#define WARP_PYTHON_BINDINGS_XLACALL_H

#include "Native.h"
#include "XlaFfi.h"

#include <cstring>
#include <string_view>

namespace warp::python {

[[noreturn]] inline void fail(const std::string &message) {
  throw Error(Error::Kind::Launch, "jax_kernel: " + message);
}

/// The number that the traced program has for the call.
inline int64_t callNumber(const xla::Attributes &attributes) {
  for (int64_t i = 0; i < attributes.count; ++i) {
    const xla::Span &name = *attributes.names[i];
    if (attributes.kinds[i] != xla::scalarAttribute ||
        std::string_view(name.data, name.size) != "call")
      continue;
    int64_t id;
    std::memcpy(&id, static_cast<xla::Number *>(attributes.items[i])->value,
                sizeof(id));
    return id;
  }
  fail("the call has no attribute 'call'");
}

inline xla::Error *makeError(const xla::Frame &frame, const char *message) {
  xla::ErrorArgs args{sizeof(args), nullptr, message, xla::internalError};
  return frame.api->createError(&args);
}

/// XLA asks for the version before the first call, and whether it may record
/// calls in graphs of its own.
inline bool answerMetadata(const xla::Frame &frame, bool recordable = false) {
  for (xla::Extension *item = frame.extensions; item; item = item->next) {
    if (item->type != xla::metadataExtension)
      continue;
    auto *answer = reinterpret_cast<xla::MetadataExtension *>(item)->metadata;
    answer->version.major = 0;
    answer->version.minor = frame.api ? frame.api->version.minor : 1;
    answer->traits = recordable ? xla::recordableTrait : 0;
    return true;
  }
  return false;
}

/// The device of a call, and its stream if that is a CUDA device.
struct CallPlace {
  int device = defaultDevice;
  void *stream = nullptr;
};

/// The place of a call on CUDA; returns an error of XLA's.
inline xla::Error *findPlace(const xla::Frame &frame, CallPlace &place) {
  const xla::Api &api = *frame.api;
  if (api.version.major != 0 || api.size < sizeof(xla::Api))
    return makeError(frame, "jax_kernel: this version of jaxlib does not say "
                            "on which device a call runs, expects a newer "
                            "one");
  xla::StreamArgs where{sizeof(where), nullptr, frame.context, nullptr};
  if (xla::Error *error = api.getStream(&where))
    return error;
  xla::OrdinalArgs which{sizeof(which), nullptr, frame.context, 0};
  if (xla::Error *error = api.getOrdinal(&which))
    return error;
  place = {which.ordinal, where.stream};
  return nullptr;
}

/// A function that XLA calls: answers questions about itself, or executes a
/// call, whose exceptions become XLA's errors.
template <auto execute, bool cuda, bool recordable = false>
xla::Error *handle(xla::Frame *frame) {
  if (answerMetadata(*frame, recordable) || frame->stage != xla::executeStage)
    return nullptr;
  CallPlace place;
  if (cuda)
    if (xla::Error *error = findPlace(*frame, place))
      return error;
  try {
    execute(*frame, place);
  } catch (const std::exception &error) {
    return makeError(*frame, error.what());
  }
  return nullptr;
}

inline pybind11::object handlerCapsule(xla::Error *(*handler)(xla::Frame *)) {
  return pybind11::reinterpret_steal<pybind11::object>(PyCapsule_New(
      reinterpret_cast<void *>(handler), "xla._CUSTOM_CALL_TARGET", nullptr));
}

void bindXlaCallback(pybind11::module_ &m);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_XLACALL_H
