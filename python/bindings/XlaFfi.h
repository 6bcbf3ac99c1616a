//===- XlaFfi.h - The binary interface of XLA's calls -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The part of XLA's foreign function interface, version 0.x, that is needed.
// XLA only ever appends to it, and every struct begins with its size.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_XLAFFI_H
#define WARP_PYTHON_BINDINGS_XLAFFI_H

#include <cstddef>
#include <cstdint>

namespace xla {

struct Error;
struct Context;

struct Extension {
  size_t size;
  int32_t type;
  Extension *next;
};
constexpr int32_t metadataExtension = 1;

struct Version {
  size_t size;
  Extension *extensions;
  int32_t major;
  int32_t minor;
};

struct Metadata {
  size_t size;
  Version version;
  uint32_t traits;
};

struct MetadataExtension {
  Extension base;
  Metadata *metadata;
};
/// A call may be recorded in a graph.
constexpr uint32_t recordableTrait = 1;

struct ErrorArgs {
  size_t size;
  Extension *extensions;
  const char *message;
  int32_t code;
};
constexpr int32_t internalError = 13;

struct StreamArgs {
  size_t size;
  Extension *extensions;
  Context *context;
  void *stream;
};

struct OrdinalArgs {
  size_t size;
  Extension *extensions;
  Context *context;
  int32_t ordinal;
};

struct Api {
  size_t size;
  Extension *extensions;
  Version version;
  const void *internal;
  Error *(*createError)(ErrorArgs *);
  void *getMessage;
  void (*destroyError)(void *);
  void *registerHandler;
  Error *(*getStream)(StreamArgs *);
  void *unused[12];
  Error *(*getOrdinal)(OrdinalArgs *);
};

struct Buffer {
  size_t size;
  Extension *extensions;
  int32_t type;
  void *data;
  int64_t rank;
  int64_t *extents;
};

/// Arguments or results.
struct Buffers {
  size_t size;
  Extension *extensions;
  int64_t count;
  int32_t *kinds;
  Buffer **items;
};

struct Span {
  const char *data;
  size_t size;
};

struct Number {
  int32_t type;
  void *value;
};
constexpr int32_t scalarAttribute = 3;

struct Attributes {
  size_t size;
  Extension *extensions;
  int64_t count;
  int32_t *kinds;
  Span **names;
  void **items;
};

struct Frame {
  size_t size;
  Extension *extensions;
  const Api *api;
  Context *context;
  int32_t stage;
  Buffers arguments;
  Buffers results;
  Attributes attributes;
};
constexpr int32_t executeStage = 3;

} // namespace xla

#endif // WARP_PYTHON_BINDINGS_XLAFFI_H
