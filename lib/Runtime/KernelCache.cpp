//===- KernelCache.cpp - Compiled code on disk ----------------------------===//
//
// One file per entry, `<key>.code`:
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

#include "Support.h"
#include "warp/Version.h"

#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <dirent.h>
#include <fcntl.h>
#include <mutex>
#include <pwd.h>
#include <random>
#include <sys/stat.h>
#include <unistd.h>

using namespace warp;

namespace {

constexpr char magic[] = {'W', 'A', 'R', 'P', 'C', 'O', 'D', 'E'};
constexpr uint32_t formatVersion = 1;
constexpr size_t keyLength = 64;
constexpr size_t headerSize = 8 + 4 + keyLength + 8 + 8;
constexpr const char *suffix = ".code";
constexpr const char *temporaryPrefix = ".writing-";
/// Leftovers of killed writers are removed after this many seconds.
constexpr time_t temporaryLifetime = 3600;

class Writer {
public:
  template <typename T> void number(T value) {
    bytes.append(reinterpret_cast<const char *>(&value), sizeof(T));
  }
  void string(const char *data, size_t size) {
    number<uint64_t>(size);
    bytes.append(data, size);
  }
  void string(const std::string &text) { string(text.data(), text.size()); }

  std::string bytes;
};

class Reader {
public:
  Reader(const char *data, size_t size) : data(data), left(size) {}

  template <typename T> T number() {
    T value{};
    if (take(sizeof(T)))
      std::memcpy(&value, data - sizeof(T), sizeof(T));
    return value;
  }
  std::string string() {
    auto size = number<uint64_t>();
    if (size > left) {
      good = false;
      return {};
    }
    take(size);
    return std::string(data - size, size);
  }
  bool atEnd() const { return good && left == 0; }
  bool ok() const { return good; }

private:
  bool take(size_t size) {
    good = good && size <= left;
    if (!good)
      return false;
    data += size;
    left -= size;
    return true;
  }

  const char *data;
  size_t left;
  bool good = true;
};

} // namespace

std::string warp::serialize(const std::string &key, const Code &code) {
  Writer payload;
  payload.string(code.entry);
  payload.string(code.binary.data(), code.binary.size());
  payload.number(code.cost);
  payload.number<uint8_t>(code.usesPrintf);
  payload.number<uint8_t>(code.exclusive);
  payload.number<int32_t>(code.items);
  payload.number<uint64_t>(code.sites.size());
  for (const Site &site : code.sites) {
    payload.string(site.kernel);
    payload.string(site.file);
    payload.string(site.array);
    payload.number<int32_t>(site.line);
    payload.number<int32_t>(site.column);
  }
  Writer file;
  file.bytes.append(magic, sizeof(magic));
  file.number(formatVersion);
  file.bytes.append(key);
  file.number<uint64_t>(payload.bytes.size());
  file.number(hashBytes(payload.bytes.data(), payload.bytes.size()));
  file.bytes += payload.bytes;
  return file.bytes;
}

std::optional<Code> warp::deserialize(const std::string &key,
                                      const std::string &bytes) {
  if (key.size() != keyLength || bytes.size() < headerSize ||
      std::memcmp(bytes.data(), magic, sizeof(magic)) != 0 ||
      bytes.compare(12, keyLength, key) != 0)
    return std::nullopt;
  uint32_t version;
  std::memcpy(&version, bytes.data() + 8, 4);
  Reader header(bytes.data() + 12 + keyLength, 16);
  auto size = header.number<uint64_t>();
  auto hash = header.number<uint64_t>();
  const char *payload = bytes.data() + headerSize;
  if (version != formatVersion || size != bytes.size() - headerSize ||
      hash != hashBytes(payload, size))
    return std::nullopt;
  Reader reader(payload, size);
  Code code;
  code.entry = reader.string();
  std::string binary = reader.string();
  code.binary.assign(binary.begin(), binary.end());
  code.cost = reader.number<double>();
  code.usesPrintf = reader.number<uint8_t>();
  code.exclusive = reader.number<uint8_t>();
  code.items = reader.number<int32_t>();
  auto sites = reader.number<uint64_t>();
  for (uint64_t i = 0; i < sites && reader.ok(); ++i) {
    Site site;
    site.kernel = reader.string();
    site.file = reader.string();
    site.array = reader.string();
    site.line = reader.number<int32_t>();
    site.column = reader.number<int32_t>();
    code.sites.push_back(std::move(site));
  }
  if (!reader.atEnd())
    return std::nullopt;
  return code;
}

//===----------------------------------------------------------------------===//
// Files
//===----------------------------------------------------------------------===//

static std::mutex cacheMutex;

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
    if (name.rfind(temporaryPrefix, 0) == 0 &&
        stat(file.c_str(), &status) == 0 &&
        now - status.st_mtime > temporaryLifetime)
      unlink(file.c_str());
  });
}

static std::optional<std::string> readFile(const std::string &path) {
  int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0)
    return std::nullopt;
  std::string bytes;
  struct stat status;
  if (fstat(file, &status) == 0 && S_ISREG(status.st_mode))
    bytes.resize(status.st_size);
  size_t done = 0;
  while (done < bytes.size()) {
    ssize_t got = read(file, bytes.data() + done, bytes.size() - done);
    if (got < 0 && errno == EINTR)
      continue;
    if (got <= 0)
      break;
    done += got;
  }
  close(file);
  bytes.resize(done);
  return bytes;
}

static bool writeFile(const std::string &path, const std::string &bytes) {
  int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0)
    return false;
  size_t done = 0;
  while (done < bytes.size()) {
    ssize_t put = write(file, bytes.data() + done, bytes.size() - done);
    if (put < 0 && errno == EINTR)
      continue;
    if (put <= 0)
      break;
    done += put;
  }
  return close(file) == 0 && done == bytes.size();
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
  std::lock_guard<std::mutex> lock(cacheMutex);
  return folder;
}

void KernelCache::setDirectory(std::string directory) {
  std::lock_guard<std::mutex> lock(cacheMutex);
  folder = directory.empty() ? defaultDirectory() : std::move(directory);
  prepared = false;
}

void KernelCache::setEnabled(bool enabled) {
  std::lock_guard<std::mutex> lock(cacheMutex);
  active = enabled;
}

bool KernelCache::enabled() const {
  std::lock_guard<std::mutex> lock(cacheMutex);
  return active;
}

std::string KernelCache::path(const std::string &key) const {
  return folder + "/" + key + suffix;
}

/// Makes the folder before the first write. Called with the lock held.
bool KernelCache::prepare() {
  if (prepared)
    return writable;
  prepared = true;
  writable = makeDirectories(folder) && access(folder.c_str(), W_OK) == 0;
  if (writable)
    removeLeftovers(folder);
  else
    notice("kernel cache '" + folder +
           "' is not writable, compiled kernels are kept in memory only");
  return writable;
}

std::optional<Code> KernelCache::find(const std::string &key) {
  std::string file;
  {
    std::lock_guard<std::mutex> lock(cacheMutex);
    if (!active)
      return std::nullopt;
    file = path(key);
  }
  std::optional<std::string> bytes = readFile(file);
  if (!bytes)
    return std::nullopt;
  std::optional<Code> code = deserialize(key, *bytes);
  if (!code)
    unlink(file.c_str());
  return code;
}

/// A file name that no other writer has, in this process or another.
static std::string temporaryName(const std::string &key) {
  static const unsigned process = std::random_device()();
  static std::atomic<unsigned> counter{0};
  return temporaryPrefix + std::to_string(getpid()) + "-" +
         std::to_string(process) + "-" + std::to_string(counter++) + "-" +
         key.substr(0, 16);
}

void KernelCache::store(const std::string &key, const Code &code) {
  std::string bytes = serialize(key, code);
  int reason = 0;
  // A second try covers a folder that somebody removed in the meantime.
  for (int attempt = 0; attempt < 2; ++attempt) {
    std::string file, temporary;
    {
      std::lock_guard<std::mutex> lock(cacheMutex);
      prepared = prepared && attempt == 0;
      if (!active || !prepare())
        return;
      file = path(key);
      temporary = folder + "/" + temporaryName(key);
    }
    if (writeFile(temporary, bytes) &&
        rename(temporary.c_str(), file.c_str()) == 0)
      return;
    reason = errno;
    unlink(temporary.c_str());
    if (reason != ENOENT)
      break;
  }
  std::lock_guard<std::mutex> lock(cacheMutex);
  if (writable)
    notice("cannot write to kernel cache '" + folder +
           "': " + std::strerror(reason));
  writable = false;
}

int KernelCache::clear() {
  std::string where = directory();
  int count = 0;
  forEachFile(where, [&](const std::string &name) {
    bool entry = endsWith(name, suffix);
    if (!entry && name.rfind(temporaryPrefix, 0) != 0)
      return;
    if (unlink((where + "/" + name).c_str()) == 0)
      count += entry;
  });
  return count;
}
