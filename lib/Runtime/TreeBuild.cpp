//===- TreeBuild.cpp - BVH builds on devices ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/TreeBuild.h"

#include "Device.h"
#include "GraphTrace.h"
#include "LaunchQueue.h"
#include "Support.h"

using namespace warp;

/// Children of a node, and primitives of a block.
static constexpr int64_t width = 8;

TreeShape::TreeShape(int64_t count) : blocks(ceilDivide(count, width)) {
  if (count == 0)
    return;
  levels = {ceilDivide(blocks, width)};
  while (levels.front() > 1)
    levels.insert(levels.begin(), ceilDivide(levels.front(), width));
}

TreeFindings::TreeFindings(int device)
    : numbers(cpuDevice, 2 * sizeof(int32_t), true), done(device) {}

std::pair<int, int> TreeFindings::wait() const {
  done.synchronize();
  return {memory()[0], memory()[1]};
}

static void run(int device, const TreeBuild &build, bool refits,
                const Stream *stream) {
  if (build.count == 0)
    return;
  // Who wants the findings waits for them.
  if (!build.findings && queueCall(device, stream, [=](const Stream *where) {
        run(device, build, refits, where);
      }))
    return;
  TraceScope tracing(device, stream);
  if (tracing)
    tracing->add(GraphOperation::Kind::BuildTree,
                 graphs::BuildTree{build.first, build.second, build.nodes,
                                   build.blocks, build.scale, build.found,
                                   build.points, build.count, build.ofTriangles,
                                   build.alongCurve, refits});
  deviceAt(device).buildTree(build, refits, stream);
}

void warp::buildTree(int device, const TreeBuild &build, const Stream *stream) {
  run(device, build, false, stream);
}

void warp::refitTree(int device, const TreeBuild &build, const Stream *stream) {
  run(device, build, true, stream);
}
