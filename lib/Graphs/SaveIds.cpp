//===- SaveIds.cpp - Handles of geometry in a saved graph -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A loaded graph has geometry of its own, so ids get other values. The compiler
// says which words of a kernel are ids, and which become ids elsewhere
// (`IdFlow`); an array that one launch takes ids from makes ids of what others
// store there, of what is copied there, and so on backwards. Any other number
// stays, whatever value it has.
//
//===----------------------------------------------------------------------===//

#include "Saver.h"

#include "Runtime/KernelImpl.h"
#include "Runtime/Support.h"

#include <algorithm>
#include <cstring>
#include <numeric>

using namespace warp;
using namespace warp::graphs;
using Kind = GraphOperation::Kind;

//===----------------------------------------------------------------------===//
// Words of memory
//===----------------------------------------------------------------------===//

/// Bytes that divide the distance of any two elements of an array.
static uint64_t stepOf(const ArrayDescriptor &array, uint64_t elementSize) {
  uint64_t step = 0;
  for (int i = 0; i < array.ndim; ++i)
    if (array.shape[i] > 1)
      step = std::gcd(step, uint64_t(std::abs(int64_t(array.strides[i]))));
  return step ? step : elementSize;
}

/// True if a number of either sequence may be one of the other.
static bool mayMeet(uint64_t first, uint64_t step, uint64_t other,
                    uint64_t otherStep) {
  return int64_t(first - other) % int64_t(std::gcd(step, otherStep)) == 0;
}

bool Saver::mayHaveIds(const AddressRange &range, uint64_t first,
                       uint64_t step) const {
  return std::any_of(idArrays.begin(), idArrays.end(), [&](const IdArray &ids) {
    return ids.range.overlaps(range) &&
           mayMeet(first, step, ids.first, ids.step);
  });
}

/// True if that is news.
bool Saver::addIdArray(IdArray array) {
  bool isKnown =
      std::any_of(idArrays.begin(), idArrays.end(), [&](const IdArray &known) {
        return known.range.begin <= array.range.begin &&
               known.range.end >= array.range.end &&
               array.step % known.step == 0 &&
               mayMeet(array.first, array.step, known.first, known.step);
      });
  if (!isKnown)
    idArrays.push_back(std::move(array));
  return !isKnown;
}

//===----------------------------------------------------------------------===//
// Sources of ids
//===----------------------------------------------------------------------===//

/// Takes over the words of a launch that may be ids by what is known so far.
bool Saver::followLaunch(size_t number) {
  const GraphOperation &operation = operations[number];
  const SavedKernel &saved = module.kernels[kernels[number]];
  auto arrayOf = [&](const IdWord &word) {
    const Access &access = saved.accesses[word.access];
    ArrayDescriptor array;
    std::memcpy(&array, operation.arguments.data() + access.offset,
                sizeof(array));
    return IdArray{rangeOf(array.data, array, access.elementSize, 1),
                   reinterpret_cast<uint64_t>(array.data) + word.offset,
                   stepOf(array, access.elementSize), describe(operation)};
  };
  bool found = false;
  for (const IdFlow &flow : saved.idFlows) {
    if (flow.to) {
      IdArray target = arrayOf(*flow.to);
      if (!mayHaveIds(target.range, target.first, target.step))
        continue;
    }
    if (flow.from.access >= 0) {
      IdArray source = arrayOf(flow.from);
      found |= source.range.begin != source.range.end && addIdArray(source);
      continue;
    }
    std::vector<HandleWord> &words = handleWords[number];
    auto at = uint64_t(flow.from.offset);
    uint64_t word;
    std::memcpy(&word, operation.arguments.data() + at, sizeof word);
    bool isKnown =
        std::any_of(words.begin(), words.end(),
                    [&](const HandleWord &known) { return known.at == at; });
    if (isKnown)
      continue;
    if (std::optional<uint32_t> id = handles.find(word, describe(operation)))
      words.push_back({at, *id});
  }
  return found;
}

/// A copy to memory that may have ids copies ids.
bool Saver::followCopy(size_t number) {
  const GraphOperation &operation = operations[number];
  bool found = false;
  if (operation.kind == Kind::CopyBytes) {
    AddressRange to = pointers[number][0].range,
                 from = pointers[number][1].range;
    uint64_t shift = from.begin - to.begin;
    for (size_t i = 0; i < idArrays.size(); ++i) {
      IdArray ids = idArrays[i];
      if (from.begin == from.end || !ids.range.overlaps(to))
        continue;
      AddressRange part{std::max(ids.range.begin, to.begin) + shift,
                        std::min(ids.range.end, to.end) + shift};
      found |=
          addIdArray({part, ids.first + shift, ids.step, describe(operation)});
    }
    return found;
  }
  auto copy = operation.read<CopyArray>();
  // The gradient of an array comes behind its data.
  AddressRange to = pointers[number][0].range, from = pointers[number][2].range;
  auto target = reinterpret_cast<uint64_t>(copy.dst.data),
       source = reinterpret_cast<uint64_t>(copy.src.data);
  if (from.begin == from.end)
    return false;
  for (uint64_t at = 0; at + sizeof(uint64_t) <= copy.elementSize; at += 4)
    if (mayHaveIds(to, target + at, stepOf(copy.dst, copy.elementSize)))
      found |=
          addIdArray({from, source + at, stepOf(copy.src, copy.elementSize),
                      describe(operation)});
  return found;
}

void Saver::findIds() {
  bool found = true;
  while (std::exchange(found, false))
    for (size_t i = 0; i < operations.size(); ++i) {
      Kind kind = operations[i].kind;
      if (kind == Kind::Launch)
        found |= followLaunch(i);
      else if (kind == Kind::CopyBytes || kind == Kind::CopyArray)
        found |= followCopy(i);
    }
  // Ids in arrays lead to more memory.
  for (const IdArray &ids : idArrays) {
    std::string bytes(ids.range.end - ids.range.begin, '\0');
    download(bytes.data(), reinterpret_cast<const void *>(ids.range.begin),
             device, bytes.size());
    idsIn(ids.range, bytes);
  }
  // So do those that operations write.
  for (size_t i = 0; i < operations.size(); ++i) {
    std::string constant = operations[i].constant;
    idsOfConstant(i, constant);
  }
}

//===----------------------------------------------------------------------===//
// Ids in contents
//===----------------------------------------------------------------------===//

/// Takes the word at a byte, if it is an id; it becomes zero.
void Saver::takeId(std::string &bytes, uint64_t at, const std::string &where,
                   std::vector<HandleWord> &words) {
  uint64_t word;
  std::memcpy(&word, bytes.data() + at, sizeof word);
  std::optional<uint32_t> id = handles.find(word, where);
  if (!id)
    return;
  std::memset(bytes.data() + at, 0, sizeof word);
  words.push_back({at, *id});
}

/// Ids in the bytes of a range of memory; they become zeros.
std::vector<HandleWord> Saver::idsIn(const AddressRange &range,
                                     std::string &bytes) {
  std::vector<HandleWord> words;
  for (const IdArray &ids : idArrays) {
    uint64_t begin = std::max(ids.range.begin, range.begin);
    uint64_t end = std::min(ids.range.end, range.begin + bytes.size());
    if (!ids.range.overlaps(range))
      continue;
    // The first word behind that, forwards or backwards from the one known.
    int64_t behind = int64_t(begin - ids.first) % int64_t(ids.step);
    uint64_t place =
        begin + (behind > 0 ? ids.step - behind : uint64_t(-behind));
    for (; place + sizeof(uint64_t) <= end; place += ids.step)
      takeId(bytes, place - range.begin, ids.where, words);
  }
  return words;
}

/// Ids in what a fill repeats; they become zeros.
std::vector<HandleWord> Saver::idsOfFill(size_t number, std::string &pattern) {
  const GraphOperation &operation = operations[number];
  uint64_t start = reinterpret_cast<uint64_t>(operation.read<FillBytes>().dst);
  uint64_t step = pattern.size();
  if (operation.kind == Kind::FillArray) {
    auto array = operation.read<FillArray>().dst;
    start = reinterpret_cast<uint64_t>(array.data);
    step = stepOf(array, pattern.size());
  }
  std::vector<HandleWord> words;
  for (uint64_t at = 0; at + sizeof(uint64_t) <= pattern.size(); at += 4)
    if (mayHaveIds(pointers[number][0].range, start + at, step))
      takeId(pattern, at, describe(operation), words);
  return words;
}

/// Ids in the constant of an operation; they become zeros.
std::vector<HandleWord> Saver::idsOfConstant(size_t number,
                                             std::string &constant) {
  switch (operations[number].kind) {
  case Kind::Upload:
    return idsIn(pointers[number][0].range, constant);
  case Kind::FillBytes:
  case Kind::FillArray:
    return idsOfFill(number, constant);
  default:
    return {};
  }
}
