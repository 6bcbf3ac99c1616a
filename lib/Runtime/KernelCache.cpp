//===- KernelCache.cpp - Compiled code on disk ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One file per entry, `<key>.code` for compiled code:
//
//   magic "WARPCODE" | format version | key (64 characters)
//   | length of the payload | hash of the payload | payload
//
// The payload is `Code`, field by field, numbers little-endian as in memory,
// strings with their length in front. Reading trusts nothing: every length is
// checked against what is left, and a file that is not exactly right is
// deleted and counts as absent.
//
//===----------------------------------------------------------------------===//

#include "warp/KernelCache.h"
#include "warp/Forks.h"

#include "BackgroundThread.h"
#include "Bytes.h"
#include "KernelClaim.h"
#include "MachineCode.h"
#include "Support.h"
#include "warp/Translation.h"
#include "warp/Version.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <dirent.h>
#include <fcntl.h>
#include <pwd.h>
#include <random>
#include <sys/stat.h>
#include <unistd.h>

using namespace warp;

namespace {

constexpr char magic[] = {'W', 'A', 'R', 'P', 'C', 'O', 'D', 'E'};
constexpr uint32_t formatVersion = 11;
constexpr const char *suffix = ".code";
constexpr const char *temporaryPrefix = ".writing-";
/// Leftovers of killed writers are removed after this many seconds.
constexpr time_t temporaryLifetime = 3600;

} // namespace

std::string warp::serialize(const std::string &key, const Code &code) {
  Writer payload;
  writeCode(payload, code);
  return seal(magic, formatVersion, key, payload.bytes);
}

std::optional<Code> warp::deserialize(const std::string &key,
                                      const std::string &bytes) {
  std::optional<std::string_view> payload =
      unseal(magic, formatVersion, key, bytes);
  if (!payload)
    return std::nullopt;
  Reader reader(payload->data(), payload->size());
  Code code = readCode(reader);
  if (!reader.atEnd())
    return std::nullopt;
  return code;
}

//===----------------------------------------------------------------------===//
// Files
//===----------------------------------------------------------------------===//

static ForkMutex cacheMutex;

static std::string homeFolder() {
  std::string home = environment("HOME");
  if (!home.empty())
    return home;
  passwd *entry = getpwuid(getuid());
  return entry && entry->pw_dir ? entry->pw_dir : "/tmp";
}

static std::string defaultDirectory() {
  std::string path = environment("WARP_CACHE_PATH");
  if (!path.empty())
    return path;
  std::string base = environment("XDG_CACHE_HOME");
  if (base.empty())
    base = homeFolder() + "/.cache";
  return base + "/warp-mlir/" + version();
}

static bool makeDirectories(const std::string &path) {
  for (size_t slash = 1; slash != std::string::npos;) {
    slash = path.find('/', slash + 1);
    std::string part = path.substr(0, slash);
    if (mkdir(part.c_str(), 0777) != 0 && errno != EEXIST && errno != EISDIR) {
      struct stat status;
      if (stat(part.c_str(), &status) != 0)
        return false;
    }
  }
  struct stat status;
  return stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode);
}

template <typename Fn>
static void forEachFile(const std::string &folder, Fn &&fn) {
  DIR *directory = opendir(folder.c_str());
  if (!directory)
    return;
  while (dirent *entry = readdir(directory))
    fn(std::string(entry->d_name));
  closedir(directory);
}

static bool endsWith(const std::string &text, const std::string &end) {
  return text.size() >= end.size() &&
         text.compare(text.size() - end.size(), end.size(), end) == 0;
}

static void removeLeftovers(const std::string &folder) {
  time_t now = time(nullptr);
  forEachFile(folder, [&](const std::string &name) {
    std::string file = folder + "/" + name;
    struct stat status;
    if ((name.rfind(temporaryPrefix, 0) == 0 || endsWith(name, claimSuffix)) &&
        stat(file.c_str(), &status) == 0 &&
        now - status.st_mtime > temporaryLifetime)
      unlink(file.c_str());
  });
}

/// Seconds by which the times of last use may be wrong.
static constexpr time_t useGrain = 3600;

/// The time of a file's last change stands for that of its last use. A folder
/// that cannot be written keeps its times.
static void noteUse(const std::string &file) {
  struct stat status;
  if (stat(file.c_str(), &status) == 0 &&
      time(nullptr) - status.st_mtime > useGrain)
    (void)utimensat(AT_FDCWD, file.c_str(), nullptr, 0);
}

//===----------------------------------------------------------------------===//
// KernelCache
//===----------------------------------------------------------------------===//

KernelCache &KernelCache::get() {
  static KernelCache *cache = new KernelCache(defaultDirectory());
  return *cache;
}

KernelCache::KernelCache(std::string directory)
    : folder(std::move(directory)) {}

std::string KernelCache::directory() const {
  std::lock_guard lock(cacheMutex);
  return folder;
}

void KernelCache::setDirectory(std::string directory) {
  std::lock_guard lock(cacheMutex);
  folder = directory.empty() ? defaultDirectory() : std::move(directory);
  prepared = false;
}

void KernelCache::setEnabled(bool enabled) {
  std::lock_guard lock(cacheMutex);
  active = enabled;
}

bool KernelCache::enabled() const {
  std::lock_guard lock(cacheMutex);
  return active;
}

/// Makes the folder before the first write. Called with the lock held.
bool KernelCache::prepare(std::string &message) {
  if (prepared)
    return writable;
  prepared = true;
  writable = makeDirectories(folder) && access(folder.c_str(), W_OK) == 0;
  if (writable)
    removeLeftovers(folder);
  else
    message = "kernel cache '" + folder +
              "' is not writable, compiled kernels are kept in memory only";
  return writable;
}

std::optional<std::string> KernelCache::read(const std::string &name) {
  std::string file;
  {
    std::lock_guard lock(cacheMutex);
    if (!active)
      return std::nullopt;
    file = folder + "/" + name;
  }
  std::optional<std::string> bytes = readFile(file);
  if (bytes)
    noteUse(file);
  return bytes;
}

void KernelCache::remove(const std::string &name) {
  unlink((directory() + "/" + name).c_str());
}

std::optional<Code> KernelCache::find(const std::string &key) {
  std::optional<std::string> bytes = read(key + suffix);
  if (!bytes)
    return std::nullopt;
  std::optional<Code> code = deserialize(key, *bytes);
  if (!code)
    remove(key + suffix);
  return code;
}

void KernelCache::store(const std::string &key, const Code &code) {
  write(key + suffix, serialize(key, code));
}

/// A file name that no other writer has, in this process or another.
static std::string temporaryName(const std::string &key) {
  static const unsigned process = std::random_device()();
  static std::atomic<unsigned> counter{0};
  return temporaryPrefix + std::to_string(getpid()) + "-" +
         std::to_string(process) + "-" + std::to_string(counter++) + "-" +
         key.substr(0, 16);
}

bool KernelCache::prepareToWrite() {
  std::string message;
  bool possible;
  {
    std::lock_guard lock(cacheMutex);
    possible = active && prepare(message);
  }
  if (!message.empty())
    notice(message);
  return possible;
}

void KernelCache::write(const std::string &name, const std::string &bytes) {
  std::string message;
  write(name, bytes, message);
  // Without the lock: who gets it may wait for one that has it.
  if (!message.empty())
    notice(message);
}

void KernelCache::write(const std::string &name, const std::string &bytes,
                        std::string &message) {
  int reason = 0;
  // A second try covers a folder that somebody removed in the meantime.
  for (int attempt = 0; attempt < 2; ++attempt) {
    std::string file, temporary;
    {
      std::lock_guard lock(cacheMutex);
      prepared = prepared && attempt == 0;
      if (!active || !prepare(message))
        return;
      file = folder + "/" + name;
      temporary = folder + "/" + temporaryName(name);
    }
    if (writeFile(temporary, bytes) &&
        rename(temporary.c_str(), file.c_str()) == 0)
      return noteWritten(bytes.size());
    reason = errno;
    unlink(temporary.c_str());
    if (reason != ENOENT)
      break;
  }
  std::lock_guard lock(cacheMutex);
  if (writable)
    message = "cannot write to kernel cache '" + folder +
              "': " + std::strerror(reason);
  writable = false;
}

int KernelCache::clear() {
  std::string where = directory();
  int count = 0;
  forEachFile(where, [&](const std::string &name) {
    bool entry = endsWith(name, suffix);
    if (endsWith(name, ".kernel") || endsWith(name, ".lanes") ||
        endsWith(name, ".launches") || endsWith(name, ".machine") ||
        endsWith(name, claimSuffix))
      unlink((where + "/" + name).c_str());
    if (!entry && name.rfind(temporaryPrefix, 0) != 0)
      return;
    if (unlink((where + "/" + name).c_str()) == 0)
      count += entry;
  });
  return count;
}

//===----------------------------------------------------------------------===//
// Size
//===----------------------------------------------------------------------===//

/// Length of a key.
static constexpr size_t keyLength = 64;

static std::string kernelOf(const std::string &place, const std::string &key,
                            const std::string &kind) {
  // Times of lanes are those of the code of the same name.
  if (kind == "lanes")
    return kernelOf(place, key, "code");
  // Their name has that of a card in it.
  if (kind == "launches")
    return "";
  std::optional<std::string> bytes = readFile(place + key + "." + kind);
  if (!bytes)
    return "";
  if (kind == "code") {
    std::optional<Code> code = deserialize(key, *bytes);
    return code ? code->entry : "";
  }
  if (kind == "machine") {
    std::optional<MachineCode> code = deserializeMachineCode(key, *bytes);
    return code ? code->entry : "";
  }
  std::optional<Translation> found = deserializeTranslation(key, *bytes);
  return found ? kernelNameOf(*found) : "";
}

std::vector<CacheEntry> KernelCache::entries(bool named) const {
  std::string where = directory();
  std::vector<CacheEntry> found;
  forEachFile(where, [&](const std::string &name) {
    size_t dot = name.rfind('.');
    struct stat status;
    if (dot != keyLength || stat((where + "/" + name).c_str(), &status) != 0)
      return;
    CacheEntry entry{name, name.substr(dot + 1), "", status.st_size,
                     status.st_mtime};
    if (entry.kind == "code" || entry.kind == "machine" ||
        entry.kind == "kernel" || entry.kind == "lanes" ||
        entry.kind == "launches")
      found.push_back(std::move(entry));
  });
  std::sort(found.begin(), found.end(),
            [](const CacheEntry &a, const CacheEntry &b) {
              return a.used != b.used ? a.used > b.used : a.file < b.file;
            });
  if (named)
    for (CacheEntry &entry : found)
      entry.kernel =
          kernelOf(where + "/", entry.file.substr(0, keyLength), entry.kind);
  return found;
}

void KernelCache::setLimit(int64_t bytes) {
  std::lock_guard lock(cacheMutex);
  limit = bytes;
  untilTrim = 0;
}

int64_t KernelCache::trim() {
  int64_t most;
  {
    std::lock_guard lock(cacheMutex);
    most = limit;
  }
  if (most <= 0)
    return 0;
  std::vector<CacheEntry> files = entries(/*named=*/false);
  int64_t total = 0, removed = 0;
  for (const CacheEntry &entry : files)
    total += entry.bytes;
  if (total > most)
    while (!files.empty() && total - removed > most / 10 * 9) {
      remove(files.back().file);
      removed += files.back().bytes;
      files.pop_back();
    }
  std::lock_guard lock(cacheMutex);
  // Other processes write, too.
  untilTrim = std::max<int64_t>(1, (most - total + removed) / 4);
  return removed;
}

void KernelCache::noteWritten(size_t bytes) {
  {
    std::lock_guard lock(cacheMutex);
    untilTrim -= static_cast<int64_t>(bytes);
    if (untilTrim > 0 || limit <= 0)
      return;
    // Nobody else begins meanwhile.
    untilTrim = limit;
  }
  // The process's cache lives as long as it does; others are those of tests.
  if (this == &get())
    background::add([this] { trim(); });
  else
    trim();
}
