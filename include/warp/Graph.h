//===- Graph.h - Graphs: recorded work, one call to replay ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Between `Capture::begin` and `end`, launches, copies and fills are recorded
// and not run; the graph that comes out repeats them with one call. On CUDA
// the driver records what is queued on a stream, and on others that wait for
// it; on the CPU the runtime records what the calling thread does. Memory
// freed in between belongs to the graph from then on. Everything else a graph
// uses, arrays and kernels, must outlive it; the Python layer sees to that.
//
// Branches and loops depend on an int32 in device memory that is read when the
// graph runs. A condition is made first, then bodies that run if it holds:
//
//   Capture::Condition condition = capture->addCondition(value);
//   capture->beginBody(condition, /*loop=*/true);
//   ... launches ...
//   capture->updateCondition(condition, value);
//   capture->endBody();
//
// A CPU graph may call functions of the host in between, such as exchanges of
// messages with other processes (`Capture::addHost`).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_GRAPH_H
#define WARP_GRAPH_H

#include "warp/Device.h"
#include "warp/Export.h"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace warp {

class GraphTrace;

/// The threads that may meanwhile do what a CUDA capture cannot hold.
enum class CaptureMode { Global = 0, ThreadLocal = 1, Relaxed = 2 };

/// Nodes run in the order of their recording, or behind those alone that they
/// depend on; or both ways, to compare what they leave.
enum class NodeOrder { Recorded = 0, Dependencies = 1, Verified = 2 };

/// The order of a graph's nodes, as GraphOrder.cpp found it.
struct GraphSchedule {
  /// A node that another one comes behind, and why.
  struct Edge {
    int from = 0;
    std::string reason;
  };
  /// The nodes of one call of the runtime.
  struct Node {
    std::string name;
    std::vector<Edge> before;
    /// Why it keeps its place among all others; empty if it need not.
    std::string barrier;
    /// Number of the chain of nodes that it belongs to.
    int branch = 0;
    int64_t threads = 0, bytes = 0;
    /// The body of a branch or loop.
    std::shared_ptr<const GraphSchedule> body;
    /// The launches that are one here; empty for a single one.
    std::vector<std::string> parts;
    /// Why a launch is not fused with one of equal extents before it.
    std::string apart;
  };

  std::vector<Node> nodes;
  int branches = 0;
  size_t recordedEdges = 0, edges = 0;
  /// Why the graph runs in the order of its recording; empty if it does not.
  std::string kept;
};

class WARP_API Graph : public std::enable_shared_from_this<Graph> {
public:
  virtual ~Graph();

  int device() const { return deviceIndex; }
  /// CUDA: queued on `stream`, or on the device's current one. CPU: run now,
  /// or recorded if the thread is recording.
  virtual void launch(const Stream *stream = nullptr) = 0;
  /// Number of nodes; those inside of bodies are not counted.
  virtual size_t size() const = 0;
  /// CUDA: launches whose code was compiled quickly and will be exchanged.
  virtual size_t provisionalLaunches() const { return 0; }
  /// True if a launch gives its thread back at once, or nearly so.
  virtual bool isShort() const = 0;
  /// Writes a Graphviz file.
  virtual void writeDot(const std::string &path, bool verbose) const = 0;

  /// The capture that it comes from, if it is to be saved (warp/SavedGraph.h).
  const GraphTrace *trace() const;
  /// The operations of its capture, if they were noted.
  const GraphTrace *operations() const { return recorded.get(); }
  /// Null for a capture that was not to be put in order.
  virtual std::shared_ptr<const GraphSchedule> schedule() const {
    return ordered;
  }

protected:
  explicit Graph(int device) : deviceIndex(device) {}

private:
  friend class CaptureBase;
  int deviceIndex;
  std::shared_ptr<const GraphTrace> recorded;
  std::shared_ptr<const GraphSchedule> ordered;
};

/// A recording in progress; destroyed before its end it leaves no trace.
class WARP_API Capture {
public:
  using Condition = uint64_t;

  /// `stream` is for CUDA, null means the current one. `external`: somebody
  /// else started to capture that stream and will end it; the graph then is
  /// theirs and ours only keeps memory alive. `traced`: the graph is to be
  /// saved.
  static std::unique_ptr<Capture>
  begin(int device, std::shared_ptr<Stream> stream = nullptr,
        CaptureMode mode = CaptureMode::ThreadLocal, bool external = false,
        bool traced = false, NodeOrder order = NodeOrder::Recorded);
  virtual ~Capture();
  Capture(const Capture &) = delete;
  Capture &operator=(const Capture &) = delete;

  int device() const { return deviceIndex; }
  virtual std::shared_ptr<Graph> end() = 0;

  /// True if `*value` is not zero (if `negated`: is zero) at that point.
  virtual Condition addCondition(const int32_t *value, bool negated) = 0;
  /// The same, again, for an existing condition.
  virtual void updateCondition(Condition condition, const int32_t *value,
                               bool negated) = 0;
  virtual void beginBody(Condition condition, bool loop) = 0;
  virtual void endBody() = 0;

  /// CPU: calls a function at this point of each replay, on the thread that
  /// replays. `name` is for messages and pictures. Such a graph cannot be
  /// saved.
  virtual void addHost(std::function<void()> function, const std::string &name);
  /// Notes that another library has added work here: the graph cannot be saved,
  /// and the error says `what` it is.
  void noteOther(std::string what);

protected:
  explicit Capture(int device) : deviceIndex(device) {}

private:
  int deviceIndex;
};

/// True if work for a device is being recorded: on the CPU by this thread, on
/// CUDA by anyone through `Capture`.
WARP_API bool isCapturing(int device);
/// True if the driver has conditional nodes.
WARP_API bool supportsConditionalGraphs();

} // namespace warp

#endif // WARP_GRAPH_H
