//===- RepeatOperations.cpp - Replay of saved operations ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Geometry.h"
#include "Operations.h"

#include "warp/Error.h"
#include "warp/Memory.h"
#include "warp/SparseProduct.h"
#include "warp/TreeBuild.h"

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

static Capture::Condition conditionOf(const GraphOperation &operation,
                                      const Conditions &conditions,
                                      uint32_t number) {
  auto found = conditions.find(number);
  if (found == conditions.end())
    throw nonsense(operation);
  return found->second;
}

static void repeatSequence(const GraphOperation &operation, int device,
                           const Stream *stream) {
  auto pairsOf = [](const auto &sort) {
    return Pairs{static_cast<NumberType>(sort.type), sort.keys, sort.values,
                 sort.valueSize, sort.count};
  };
  if (operation.kind == Kind::Scan) {
    auto scan = operation.read<Scan>();
    return scanNumbers(device, static_cast<NumberType>(scan.type), scan.width,
                       scan.out, scan.in, scan.count, scan.inclusive != 0,
                       stream);
  }
  if (operation.kind == Kind::SortPairs) {
    auto sort = operation.read<SortPairs>();
    return sortPairs(device, pairsOf(sort), sort.beginBit, sort.endBit, stream);
  }
  if (operation.kind == Kind::SortSegments) {
    auto sort = operation.read<SortSegments>();
    return sortSegments(device, pairsOf(sort), sort.begins, sort.ends,
                        sort.segments, stream);
  }
  auto runs = operation.read<FindRuns>();
  findRuns(device,
           {static_cast<int>(runs.size), runs.numbers, runs.count,
            runs.runNumbers, runs.runLengths, runs.runCount},
           stream);
}

static void repeatCondition(const GraphOperation &operation, Capture &capture,
                            Conditions &conditions) {
  if (operation.kind == Kind::EndBody)
    return capture.endBody();
  if (operation.kind == Kind::BeginBody) {
    auto body = operation.read<Body>();
    return capture.beginBody(conditionOf(operation, conditions, body.number),
                             body.loop != 0);
  }
  auto condition = operation.read<Condition>();
  bool negated = condition.negated != 0;
  if (operation.kind == Kind::UpdateCondition)
    return capture.updateCondition(
        conditionOf(operation, conditions, condition.number), condition.value,
        negated);
  conditions[condition.number] = capture.addCondition(condition.value, negated);
}

void graphs::repeat(GraphOperation &operation, int device, int blockDim,
                    const Stream *stream, Capture &capture,
                    Conditions &conditions, const Geometry &geometry) {
  std::string &constant = operation.constant;
  switch (operation.kind) {
  case Kind::Launch: {
    // The block of a launch is aligned like the numbers in it.
    std::vector<uint64_t> block(operation.arguments.size() / 8);
    std::memcpy(block.data(), operation.arguments.data(), block.size() * 8);
    return operation.kernel->launch(device, operation.dim, block.data(), stream,
                                    blockDim);
  }
  case Kind::CopyBytes: {
    auto copy = operation.read<CopyBytes>();
    return copyMemory(copy.dst, device, copy.src, device, copy.bytes, stream);
  }
  case Kind::CopyArray: {
    auto copy = operation.read<CopyArray>();
    return copyArray({&copy.dst, device}, {&copy.src, device}, copy.elementSize,
                     stream);
  }
  case Kind::Upload:
    return upload(operation.read<Upload>().dst, device, constant.data(),
                  constant.size(), stream);
  case Kind::FillBytes: {
    auto fill = operation.read<FillBytes>();
    return fillMemory(fill.dst, device, constant.data(), constant.size(),
                      fill.count, stream);
  }
  case Kind::FillArray: {
    auto fill = operation.read<FillArray>();
    return fillArray({&fill.dst, device}, constant.data(), constant.size(),
                     stream);
  }
  case Kind::Condition:
  case Kind::UpdateCondition:
  case Kind::BeginBody:
  case Kind::EndBody:
    return repeatCondition(operation, capture, conditions);
  case Kind::Other:
    throw nonsense(operation);
  case Kind::UpdateGeometry:
    return geometry.update(operation.read<UpdateGeometry>());
  case Kind::MultiplyRows:
    return multiplyRows(device, operation.read<SparseProduct>(), stream);
  case Kind::BuildTree: {
    auto tree = operation.read<graphs::BuildTree>();
    if (isHost(device))
      throw nonsense(operation);
    TreeBuild build{tree.first,
                    tree.points,
                    tree.second,
                    tree.count,
                    tree.ofTriangles != 0,
                    tree.alongCurve != 0,
                    tree.nodes,
                    tree.blocks,
                    static_cast<float *>(tree.scale),
                    static_cast<int32_t *>(tree.found)};
    return tree.refits ? refitTree(device, build, stream)
                       : buildTree(device, build, stream);
  }
  default:
    return repeatSequence(operation, device, stream);
  }
}
