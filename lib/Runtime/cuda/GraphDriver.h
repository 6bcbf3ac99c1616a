//===- GraphDriver.h - The driver's calls for graphs ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Kept apart from the table in CudaDriver.h, since everything but graphs works
// with a driver that lacks them. A missing entry is null.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_GRAPHDRIVER_H
#define WARP_LIB_RUNTIME_CUDA_GRAPHDRIVER_H

#include "Driver.h"

namespace warp::cuda {

using GraphHandle = struct GraphTag *;
using GraphExec = struct GraphExecTag *;
using GraphNode = struct GraphNodeTag *;
using ConditionHandle = uint64_t;

enum : Result {
  errorCaptureUnsupported = 900,
  errorCaptureInvalidated = 901,
  errorCaptureUnjoined = 904,
  errorCaptureImplicit = 906,
};

enum CaptureStatus : int { captureNone = 0, captureActive = 1 };
enum : int { captureRelaxed = 2 };
enum : unsigned { setDependencies = 1 };
enum : unsigned { dotVerbose = 1 };

/// CUgraphNodeParams of a conditional node.
struct ConditionalNode {
  int type = 13;
  int reserved0[3] = {};
  ConditionHandle handle = 0;
  /// 0: if, 1: while.
  int kind = 0;
  unsigned size = 1;
  GraphHandle *bodies = nullptr;
  Context context = nullptr;
  int64_t padding[25] = {};
  int64_t reserved2 = 0;
};
static_assert(sizeof(ConditionalNode) == 256);

/// CUgraphNodeType.
enum : int {
  nodeKernel = 0,
  nodeCopy = 1,
  nodeFill = 2,
  nodeGraph = 4,
  nodeEmpty = 5,
  nodeWait = 6,
  nodeRecord = 7,
  nodeConditional = 13,
};

/// CUDA_KERNEL_NODE_PARAMS_v2.
struct KernelNode {
  Function function = nullptr;
  unsigned grid[3] = {}, block[3] = {}, sharedBytes = 0;
  void **arguments = nullptr, **extra = nullptr;
  void *kernel = nullptr;
  Context context = nullptr;
};
static_assert(sizeof(KernelNode) == 72);

/// CUDA_MEMCPY3D and CUDA_MEMSET_NODE_PARAMS; only passed on.
struct CopyNode {
  uint64_t words[25] = {};
};
struct FillNode {
  uint64_t words[5] = {};
};

/// CUgraphEdgeData.
struct EdgeData {
  unsigned char bytes[8] = {};

  auto operator<=>(const EdgeData &) const = default;
  /// True if the second node may start before the first one has ended.
  bool isProgrammatic() const { return bytes[2] == 1; }
};
/// From where a kernel lets others start, to one that waits for its end.
inline constexpr EdgeData programmaticEdge = {{1, 0, 1}};

/// CUgraphExecUpdateResultInfo.
struct UpdateResult {
  int result = 0;
  GraphNode node = nullptr, from = nullptr;
};
static_assert(sizeof(UpdateResult) == 24);

#define WARP_CUDA_GRAPH_SYMBOLS(X)                                             \
  X(beginCapture, cuStreamBeginCapture_v2, (StreamHandle, int))                \
  X(endCapture, cuStreamEndCapture, (StreamHandle, GraphHandle *))             \
  X(captureInfo, cuStreamGetCaptureInfo_v2,                                    \
    (StreamHandle, CaptureStatus *, uint64_t *, GraphHandle *,                 \
     const GraphNode **, size_t *))                                            \
  X(updateDependencies, cuStreamUpdateCaptureDependencies,                     \
    (StreamHandle, GraphNode *, size_t, unsigned))                             \
  X(exchangeMode, cuThreadExchangeStreamCaptureMode, (int *))                  \
  X(instantiate, cuGraphInstantiateWithFlags,                                  \
    (GraphExec *, GraphHandle, unsigned long long))                            \
  X(launch, cuGraphLaunch, (GraphExec, StreamHandle))                          \
  X(destroyExec, cuGraphExecDestroy, (GraphExec))                              \
  X(destroy, cuGraphDestroy, (GraphHandle))                                    \
  X(getNodes, cuGraphGetNodes, (GraphHandle, GraphNode *, size_t *))           \
  X(writeDot, cuGraphDebugDotPrint, (GraphHandle, const char *, unsigned))     \
  X(addChild, cuGraphAddChildGraphNode,                                        \
    (GraphNode *, GraphHandle, const GraphNode *, size_t, GraphHandle))        \
  X(beginCaptureTo, cuStreamBeginCaptureToGraph,                               \
    (StreamHandle, GraphHandle, const GraphNode *, const void *, size_t, int)) \
  X(createCondition, cuGraphConditionalHandleCreate,                           \
    (ConditionHandle *, GraphHandle, Context, unsigned, unsigned))             \
  X(nodeType, cuGraphNodeGetType, (GraphNode, int *))                          \
  X(nodeDependencies, cuGraphNodeGetDependencies,                              \
    (GraphNode, GraphNode *, size_t *))                                        \
  X(kernelParams, cuGraphKernelNodeGetParams_v2, (GraphNode, KernelNode *))    \
  X(setKernelParams, cuGraphKernelNodeSetParams_v2,                            \
    (GraphNode, const KernelNode *))                                           \
  X(parameterInfo, cuFuncGetParamInfo, (Function, size_t, size_t *, size_t *)) \
  X(updateExec, cuGraphExecUpdate_v2,                                          \
    (GraphExec, GraphHandle, UpdateResult *))                                  \
  X(addKernel, cuGraphAddKernelNode_v2,                                        \
    (GraphNode *, GraphHandle, const GraphNode *, size_t, const KernelNode *)) \
  X(copyAttributes, cuGraphKernelNodeCopyAttributes, (GraphNode, GraphNode))   \
  X(copyParams, cuGraphMemcpyNodeGetParams, (GraphNode, CopyNode *))           \
  X(addCopy, cuGraphAddMemcpyNode,                                             \
    (GraphNode *, GraphHandle, const GraphNode *, size_t, const CopyNode *,    \
     Context))                                                                 \
  X(fillParams, cuGraphMemsetNodeGetParams, (GraphNode, FillNode *))           \
  X(addFill, cuGraphAddMemsetNode,                                             \
    (GraphNode *, GraphHandle, const GraphNode *, size_t, const FillNode *,    \
     Context))                                                                 \
  X(childGraph, cuGraphChildGraphNodeGetGraph, (GraphNode, GraphHandle *))     \
  X(addEmpty, cuGraphAddEmptyNode,                                             \
    (GraphNode *, GraphHandle, const GraphNode *, size_t))                     \
  X(getEdges, cuGraphGetEdges,                                                 \
    (GraphHandle, GraphNode *, GraphNode *, size_t *))                         \
  X(recordEvent, cuEventRecordWithFlags,                                       \
    (EventHandle, StreamHandle, unsigned))                                     \
  X(waitNodeEvent, cuGraphEventWaitNodeGetEvent, (GraphNode, EventHandle *))   \
  X(addWait, cuGraphAddEventWaitNode,                                          \
    (GraphNode *, GraphHandle, const GraphNode *, size_t, EventHandle))        \
  X(recordNodeEvent, cuGraphEventRecordNodeGetEvent,                           \
    (GraphNode, EventHandle *))                                                \
  X(addRecord, cuGraphAddEventRecordNode,                                      \
    (GraphNode *, GraphHandle, const GraphNode *, size_t, EventHandle))        \
  X(allEdges, cuGraphGetEdges_v2,                                              \
    (GraphHandle, GraphNode *, GraphNode *, EdgeData *, size_t *))             \
  X(addEdges, cuGraphAddDependencies_v2,                                       \
    (GraphHandle, const GraphNode *, const GraphNode *, const EdgeData *,      \
     size_t))                                                                  \
  X(removeEdges, cuGraphRemoveDependencies_v2,                                 \
    (GraphHandle, const GraphNode *, const GraphNode *, const EdgeData *,      \
     size_t))                                                                  \
  X(destroyNode, cuGraphDestroyNode, (GraphNode))                              \
  X(allDependencies, cuGraphNodeGetDependencies_v2,                            \
    (GraphNode, GraphNode *, EdgeData *, size_t *))                            \
  X(addNode, cuGraphAddNode,                                                   \
    (GraphNode *, GraphHandle, const GraphNode *, size_t, ConditionalNode *))

struct GraphDriver {
#define WARP_DECLARE(member, symbol, parameters) Result(*member) parameters;
  WARP_CUDA_GRAPH_SYMBOLS(WARP_DECLARE)
#undef WARP_DECLARE
  bool supportsGraphs = false;
  bool supportsConditions = false;
};

const GraphDriver &graphDriver();

/// Calls an entry of the graph table and checks the result.
#define WARP_CUDA_GRAPH(member, ...)                                           \
  ::warp::cuda::check(::warp::cuda::graphDriver().member(__VA_ARGS__),         \
                      ::warp::cuda::graphSymbol(#member))

/// The exported name of an entry.
const char *graphSymbol(const std::string &member);

/// Lets this thread do what captures forbid, where that harms none: loading
/// code, making streams, allocating. Nothing if no capture is in progress.
class RelaxedCaptures {
public:
  RelaxedCaptures();
  ~RelaxedCaptures();
  RelaxedCaptures(const RelaxedCaptures &) = delete;
  RelaxedCaptures &operator=(const RelaxedCaptures &) = delete;

private:
  int mode = captureRelaxed;
  bool changed = false;
};

} // namespace warp::cuda

#endif // WARP_LIB_RUNTIME_CUDA_GRAPHDRIVER_H
