//===- FileChecks.cpp - Validation of files: fields fit together ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "FileChecks.h"

#include <algorithm>

using namespace warp;

size_t warp::parameterBytes(const std::vector<Param> &params) {
  int64_t end = sizeof(LaunchHeader);
  for (const Param &param : params)
    end = std::max(end, param.offset + param.size);
  return size_t((end + 7) / 8 * 8);
}

static bool isOneOf(int64_t value, std::initializer_list<int64_t> values) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

static bool isWithin(int64_t value, int64_t least, int64_t most) {
  return value >= least && value <= most;
}

/// True if kind, size and arrays of an argument fit.
static bool isWhole(const Param &param) {
  for (int64_t offset : param.arrays)
    if (offset % 8 != 0 ||
        !isWithin(offset, 0, param.size - int64_t(sizeof(ArrayDescriptor))))
      return false;
  switch (param.kind) {
  case Param::Kind::Array:
    return param.size == sizeof(ArrayDescriptor) && param.rank > 0 &&
           param.arrays == std::vector<int64_t>{0};
  case Param::Kind::Struct:
    return true;
  case Param::Kind::Scalar:
  case Param::Kind::Composite:
    return param.size > 0 && param.arrays.empty();
  }
  return false;
}

/// Places of the descriptors in the parameter block, in order.
static std::vector<int64_t> placesOf(const std::vector<Param> &params) {
  std::vector<int64_t> places;
  for (const Param &param : params)
    for (int64_t offset : param.arrays)
      places.push_back(param.offset + offset);
  return places;
}

std::string warp::problemOf(const std::vector<Param> &params,
                            const std::vector<Access> &accesses) {
  for (const Param &param : params)
    if (!isWhole(param))
      return "argument '" + param.name + "' has no possible layout";
  std::vector<int64_t> places = placesOf(params);
  bool fits = places.size() == accesses.size();
  for (size_t i = 0; fits && i < places.size(); ++i)
    fits = accesses[i].offset == places[i] &&
           (accesses[i].gradientSize == 0 || accesses[i].elementSize > 0);
  return fits ? "" : "what it does with arrays does not fit its arguments";
}

std::string warp::problemOf(const std::vector<IdFlow> &flows,
                            const std::vector<Access> &accesses,
                            size_t paramSize) {
  constexpr int64_t bytes = sizeof(uint64_t);
  auto isElement = [&](const IdWord &word) {
    return isWithin(word.access, 0, int64_t(accesses.size()) - 1) &&
           isWithin(word.offset, 0, accesses[word.access].elementSize - bytes);
  };
  bool fits = std::all_of(flows.begin(), flows.end(), [&](const IdFlow &flow) {
    bool isParameter =
        flow.from.access == -1 &&
        isWithin(flow.from.offset, firstArgument, int64_t(paramSize) - bytes);
    return (isParameter || isElement(flow.from)) &&
           (!flow.to || isElement(*flow.to));
  });
  return fits ? "" : "its ids do not fit its arguments";
}

static bool isPossible(const CopiedArray &array) {
  return isOneOf(array.gradient, {0, 1}) && isOneOf(array.floating, {0, 1}) &&
         isOneOf(array.isUnsigned, {0, 1}) &&
         isOneOf(int64_t(array.kind), {0, 1, 2}) &&
         isOneOf(array.width, {32, 64}) && array.elementSize > 0 &&
         isWithin(array.numbers, 1, array.elementSize);
}

static bool isPossible(const SummedArray &array) {
  return isOneOf(array.gradient, {0, 1}) && isOneOf(array.width, {0, 32, 64}) &&
         array.elementSize >= 0 && isWithin(array.strideScale, 0, 8);
}

static bool isPossible(const TensorMap &map) {
  return isOneOf(map.elementBytes, {2, 4}) &&
         isOneOf(map.swizzle, {0, 32, 64, 128}) && isWithin(map.rows, 1, 256) &&
         isWithin(map.columns, 1, 256);
}

std::string warp::problemOf(const Code &code, const std::vector<Param> &params,
                            size_t paramSize) {
  std::vector<int64_t> places = placesOf(params);
  auto isArray = [&](int64_t place) {
    return std::find(places.begin(), places.end(), place) != places.end();
  };
  auto fits = [&](const auto &array) {
    return isPossible(array) && isArray(array.descriptor);
  };
  const Schedule &schedule = code.schedule;
  if (schedule.rowCoarsening > schedule.coarsening)
    return "the code of '" + code.entry + "' has no possible coarsening";
  if (!std::all_of(schedule.copied.list.begin(), schedule.copied.list.end(), fits) ||
      !std::all_of(schedule.sums.begin(), schedule.sums.end(), fits) ||
      !std::all_of(schedule.tensorMaps.begin(), schedule.tensorMaps.end(), fits))
    return "the code of '" + code.entry + "' is about arrays that it lacks";
  // The block ends behind the last map.
  int64_t least = int64_t(paramSize);
  for (const TensorMap &map : schedule.tensorMaps) {
    if (map.place % int64_t(tensorMapAlignment) != 0 ||
        !isWithin(map.place, least, mostParameterBytes))
      return "the code of '" + code.entry + "' has maps where arguments are";
    least = map.place + int64_t(tensorMapBytes);
  }
  return "";
}
