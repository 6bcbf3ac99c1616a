//===- LibraryCode.cpp - Archives of GPU code in the library --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/LibraryCode.h"

#include "Embedded.h"

#include "warp/Forks.h"

#include <charconv>
#include <map>
#include <mutex>

using namespace warp;

// lib/DeviceLib/CMakeLists.txt makes them: compressed archives; the objects for
// the architectures of a family are much alike.
WARP_EMBEDDED(devicelib_ampere)
WARP_EMBEDDED(devicelib_hopper)
WARP_EMBEDDED(devicelib_blackwell)
WARP_EMBEDDED(kernels_ampere)
WARP_EMBEDDED(kernels_hopper)
WARP_EMBEDDED(kernels_ptx)

static std::string_view libraryFor(std::string_view target) {
  if (target == "sm_80" || target == "sm_86" || target == "sm_89")
    return devicelib_ampere();
  if (target == "sm_90a")
    return devicelib_hopper();
  if (target == "sm_100" || target == "sm_120")
    return devicelib_blackwell();
  return {};
}

bool warp::hasAssembledLibrary(const std::string &target) {
  return !libraryFor(target).empty();
}

namespace {
/// A member's header in an archive of GNU ar.
struct MemberHeader {
  char name[16], date[12], user[6], group[6], mode[8], size[10], end[2];
};
} // namespace

/// A decimal number, or `npos`.
static size_t numberOf(std::string_view digits) {
  size_t number = 0;
  auto [rest, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return error == std::errc() ? number : std::string_view::npos;
}

/// Members of an archive whose names begin like that; none if it cannot be
/// read: kernels have their own code then.
static std::vector<std::vector<char>> unpack(std::string_view packed,
                                             const std::string &prefix) {
  std::vector<char> bytes = decompress(packed);
  std::string_view archive(bytes.data(), bytes.size()), longNames;
  constexpr std::string_view magic = "!<arch>\n";
  std::vector<std::vector<char>> found;
  if (!archive.starts_with(magic))
    return found;
  archive.remove_prefix(magic.size());
  while (archive.size() >= sizeof(MemberHeader)) {
    auto *header = reinterpret_cast<const MemberHeader *>(archive.data());
    size_t size = numberOf({header->size, sizeof header->size});
    std::string_view name(header->name, sizeof header->name);
    archive.remove_prefix(sizeof(MemberHeader));
    if (size > archive.size())
      return {};
    std::string_view content = archive.substr(0, size);
    archive.remove_prefix(std::min(size + size % 2, archive.size()));
    if (name.starts_with("// ")) {
      longNames = content;
      continue;
    }
    // "/12" is at byte 12 of the long names; every name ends in a slash.
    if (size_t at = numberOf(name.substr(1));
        name[0] == '/' && at < longNames.size())
      name = longNames.substr(at);
    if (name.starts_with(prefix))
      found.emplace_back(content.begin(), content.end());
  }
  return found;
}

const std::vector<std::vector<char>> &
warp::assembledLibrary(const std::string &target) {
  static ForkMutex mutex;
  static auto *known =
      new std::map<std::string, std::vector<std::vector<char>>>;
  std::lock_guard guard(mutex);
  auto [entry, isNew] = known->try_emplace(target);
  if (isNew)
    entry->second = unpack(libraryFor(target), target + ".");
  return entry->second;
}

std::vector<char> warp::assembledKernels(const std::string &file, int arch) {
  // Whole programs run on all later GPUs of their generation.
  int generation = arch / 10;
  std::string_view archive = generation == 8   ? kernels_ampere()
                             : generation == 9 ? kernels_hopper()
                                               : std::string_view();
  auto found =
      unpack(archive, "sm_" + std::to_string(generation) + "0." + file + ".");
  return found.empty() ? std::vector<char>() : std::move(found.front());
}

std::string warp::kernelText(const std::string &file) {
  auto found = unpack(kernels_ptx(), file + ".");
  return found.empty()
             ? ""
             : std::string(found.front().begin(), found.front().end());
}
