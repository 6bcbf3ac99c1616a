//===- GraphTrace.h - Trace of a capture, to be saved -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A capture that is to be saved or put in order notes, on every device alike,
// each operation of the runtime's public interface: what kind it is, its
// arguments as bytes, pointers included, and constants. Saving finds the memory
// behind the pointers, loading calls the same functions again (lib/Graphs);
// GraphNodes.cpp makes access regions of the arguments.
//
// The functions open a `TraceScope` when they begin; what they call in turn is
// not noted again, and an operation that fails is forgotten. The scope also
// notes between which nodes of the graph the call has put its own.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHTRACE_H
#define WARP_LIB_RUNTIME_GRAPHTRACE_H

#include "warp/Kernel.h"
#include "warp/Launch.h"
#include "warp/Sequences.h"

#include <atomic>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

namespace warp {

class CaptureBase;
class Graph;

/// A node of the graph that a capture makes: the driver's.
using NodeId = const void *;

/// The operations of one call, and its place in the graph.
struct GraphStep {
  /// A range of the trace's operations.
  size_t first = 0, last = 0;
  /// The nodes that its stream came behind before the call, and after it.
  std::vector<NodeId> before, after;
};

struct GraphOperation {
  /// The numbers are those of the file format.
  enum class Kind : uint8_t {
    Launch = 0,
    CopyBytes = 1,
    CopyArray = 2,
    Upload = 3,
    FillBytes = 4,
    FillArray = 5,
    Scan = 6,
    SortPairs = 7,
    SortSegments = 8,
    FindRuns = 9,
    Condition = 10,
    UpdateCondition = 11,
    BeginBody = 12,
    EndBody = 13,
    /// An operation that no file can hold; `constant` says which.
    Other = 14,
    BuildTree = 15,
    UpdateGeometry = 16,
    MultiplyRows = 17,
  };

  Kind kind = Kind::Other;
  /// The structs below, or the parameter block of a launch.
  std::string arguments;
  /// Bytes that an upload or a fill writes.
  std::string constant;
  /// Copies of bytes that are not to be saved: where the host has them.
  bool fromHost = false, toHost = false;
  /// Launches.
  Kernel *kernel = nullptr;
  Kernel::Plan plan;
  LaunchDim dim;

  template <typename T> T read() const {
    T value;
    std::memcpy(&value, arguments.data(), sizeof(T));
    return value;
  }
};

/// Arguments as they lie in memory and in files; those of a product are a
/// `SparseProduct`.
namespace graphs {
struct CopyBytes {
  void *dst;
  const void *src;
  uint64_t bytes;
};
struct CopyArray {
  ArrayDescriptor dst, src;
  uint64_t elementSize;
};
struct Upload {
  void *dst;
};
struct FillBytes {
  void *dst;
  uint64_t count;
};
struct FillArray {
  ArrayDescriptor dst;
};
struct Scan {
  Sequence out, in;
  int64_t count;
  int32_t type, width, inclusive, unused;
};
struct SortPairs {
  void *keys, *values;
  int64_t count;
  int32_t type, valueSize, beginBit, endBit;
};
struct SortSegments {
  void *keys, *values;
  const int32_t *begins, *ends;
  int64_t count, segments;
  int32_t type, valueSize;
};
struct FindRuns {
  const void *numbers;
  void *runNumbers;
  int32_t *runLengths, *runCount;
  int64_t count, size;
};
struct BuildTree {
  const void *first, *second;
  void *nodes, *blocks, *scale, *found;
  int64_t points;
  int32_t count, ofTriangles, alongCurve, refits;
};
/// An update of geometry by the host: takes over points, boxes or faces, or
/// builds again.
struct UpdateGeometry {
  uint64_t handle;
  double width;
  /// `GeometryKind`, whether a hierarchy is built again, and how; bytes of the
  /// numbers of points in a grid.
  int32_t kind, rebuilds, constructor, scalarSize;
  /// As the functions of the classes have them.
  ArrayDescriptor arrays[4];
};
struct Condition {
  const int32_t *value;
  uint32_t number, negated;
};
struct Body {
  uint32_t number, loop;
};
} // namespace graphs

class GraphTrace {
public:
  template <typename T>
  void add(GraphOperation::Kind kind, const T &arguments,
           std::string constant = {}) {
    static_assert(std::is_trivially_copyable_v<T>);
    GraphOperation &operation = operations.emplace_back();
    operation.kind = kind;
    operation.arguments.assign(reinterpret_cast<const char *>(&arguments),
                               sizeof(T));
    operation.constant = std::move(constant);
  }
  void addLaunch(Kernel &kernel, const Kernel::Plan &plan, const void *params);
  void addOther(std::string what);
  /// A copy from the host; its contents if the trace is to be saved.
  void addUpload(void *dst, const void *src, size_t bytes);
  /// The operations of a graph that is launched while this is recorded.
  void addGraph(const Graph &graph);
  /// Conditions get numbers in the order of their making.
  void addCondition(uint64_t handle, const int32_t *value, bool negated);
  void updateCondition(uint64_t handle, const int32_t *value, bool negated);
  void beginBody(uint64_t handle, bool loop);
  void endBody();

  std::vector<GraphOperation> operations;
  uint32_t conditions = 0;
  /// The contents that files need are noted, too.
  bool isSaved = false;
  /// The calls in each body that is open, from the graph's own inwards.
  std::vector<std::vector<GraphStep>> steps =
      std::vector<std::vector<GraphStep>>(1);
  /// The calls in bodies that have ended, by the operation that begins the
  /// body.
  std::map<size_t, std::vector<GraphStep>> bodies;

private:
  void setCondition(GraphOperation::Kind kind, uint32_t number,
                    const int32_t *value, bool negated);

  std::map<uint64_t, uint32_t> numbers;
  /// The operations that began the bodies that are open.
  std::vector<size_t> begins;
};

/// Captures in progress that keep a trace.
extern std::atomic<int> tracesInProgress;

/// Around the work of one operation on a stream, null for the current one.
class TraceScope {
public:
  TraceScope(int device, const Stream *stream) {
    if (__builtin_expect(tracesInProgress.load(std::memory_order_relaxed) != 0,
                         0))
      enter(device, stream);
  }
  ~TraceScope() {
    if (__builtin_expect(inside, 0))
      leave();
  }
  TraceScope(const TraceScope &) = delete;
  TraceScope &operator=(const TraceScope &) = delete;

  /// The trace that notes the operation; null if nobody wants to know.
  explicit operator bool() const { return trace != nullptr; }
  GraphTrace *operator->() const { return trace; }

  /// True if this thread is within one.
  static bool active();

private:
  void enter(int device, const Stream *stream);
  void leave();

  GraphTrace *trace = nullptr;
  bool inside = false;
  int exceptions = 0;
  CaptureBase *capture = nullptr;
  const Stream *stream = nullptr;
  std::unique_ptr<GraphStep> step;
};

/// While it lives, what this thread does is not within its scopes so far.
class OutsideTraces {
public:
  OutsideTraces();
  ~OutsideTraces();
  OutsideTraces(const OutsideTraces &) = delete;
  OutsideTraces &operator=(const OutsideTraces &) = delete;

private:
  int depth;
};

/// The capture with a trace that records what is queued on a stream, or what
/// this thread does on the CPU; null if there is none.
CaptureBase *findTraced(int device, const Stream *stream);

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHTRACE_H
