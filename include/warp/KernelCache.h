//===- KernelCache.h - Compiled code on disk --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A folder of files: one per compiled variant, named by the fingerprint, one
// per translation of a kernel ("warp/Translation.h"), and one per machine code
// that a CUDA driver made. When they take more than a limit, those not used for
// longest go. Any number of
// processes may use one folder: an entry is written under a temporary name and
// renamed, so a reader sees all of it or nothing, whatever happens to the
// writer. An entry that fails a check (length, key, checksum, format) is
// removed and compiled again. A folder that cannot be written costs one notice,
// never an error.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_KERNELCACHE_H
#define WARP_KERNELCACHE_H

#include "warp/Compile.h"
#include "warp/Export.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace warp {

/// A file of the cache.
struct CacheEntry {
  std::string file;
  /// `code`, `machine`, `kernel` or `lanes`, the end of its name.
  std::string kind;
  /// Empty if the file is damaged.
  std::string kernel;
  int64_t bytes = 0;
  /// Seconds since 1970 of the last use, to an hour.
  int64_t used = 0;
};

class WARP_API KernelCache {
public:
  /// The process's cache: WARP_CACHE_PATH, or `warp-mlir/<version>` in the
  /// user's cache folder.
  static KernelCache &get();

  explicit KernelCache(std::string directory);

  std::string directory() const;
  /// Moves the cache to another folder; empty means the default one.
  void setDirectory(std::string directory);
  /// Off: `find` gives nothing and `store` does nothing.
  void setEnabled(bool enabled);
  bool enabled() const;

  /// Bytes of a file in the folder, whatever they are.
  std::optional<std::string> read(const std::string &name);
  /// Writes a file: all of it or nothing. A failure costs a notice.
  void write(const std::string &name, const std::string &bytes);
  void remove(const std::string &name);
  /// Makes the folder; false if nothing can be written there.
  bool prepareToWrite();

  std::optional<Code> find(const std::string &key);
  void store(const std::string &key, const Code &code);
  /// Removes every entry; returns how many there were.
  int clear();

  /// The files, those used last first. `named`: with the names of kernels, for
  /// which they are read.
  std::vector<CacheEntry> entries(bool named = true) const;
  /// Bytes that the files may take in all, 4 GiB at first; 0 is no limit.
  void setLimit(int64_t bytes);
  /// Removes what was not used for longest until the files take nine tenths of
  /// the limit, if they take more than that; returns the bytes removed.
  int64_t trim();

private:
  /// `message` gets what the user is to be told; also of `write`.
  bool prepare(std::string &message);
  void write(const std::string &name, const std::string &bytes,
             std::string &message);

  /// Notes bytes written, and trims when they may have filled the folder.
  void noteWritten(size_t bytes);

  std::string folder;
  bool active = true, prepared = false, writable = false;
  int64_t limit = int64_t(4) << 30;
  /// Bytes to write until the folder is looked at again.
  int64_t untilTrim = 0;
};

/// The file format, exposed for tests.
WARP_API std::string serialize(const std::string &key, const Code &code);
WARP_API std::optional<Code> deserialize(const std::string &key,
                                         const std::string &bytes);

/// One-line messages to the user ("kernel cache ... is not writable"). The
/// default handler prints to standard error; null silences them.
WARP_API void setNoticeHandler(void (*handler)(const char *message));
WARP_API void notice(const std::string &message);

} // namespace warp

#endif // WARP_KERNELCACHE_H
