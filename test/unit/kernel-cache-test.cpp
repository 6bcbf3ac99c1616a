//===- kernel-cache-test.cpp - Compiled code on disk ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Runtime/Bytes.h"
#include "Runtime/KernelClaim.h"
#include "warp/KernelCache.h"

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <ctime>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <string>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vector>

using namespace warp;
namespace fs = std::filesystem;

namespace {

std::string keyOf(char digit) { return std::string(64, digit); }

Code sampleCode(size_t size = 5000) {
  Code code;
  code.entry = "saxpy_cpu";
  for (size_t i = 0; i < size; ++i)
    code.binary.push_back(static_cast<char>(i * 7 + (i >> 8)));
  code.sites = {{"saxpy", "a.py", "x", 3, 12}, {"saxpy", "a.py", "y", 4, 5}};
  code.schedule.cost = 4.5;
  code.schedule.usesPrintf = true;
  code.schedule.copied.list = {{80, 1, 12, 3, 64, 1}, {136, 0, 4, 1, 32, 0}};
  code.schedule.copied.plainTime = 3.25;
  code.schedule.copied.atomicTime = 17.5;
  code.schedule.coarsening = 8;
  code.schedule.rowCoarsening = 2;
  code.schedule.tensorMaps = {{80, 192, 64, 32, 2, 128}};
  code.schedule.sums = {{32, 80, 0, 4, 1}};
  return code;
}

void expectSame(const Code &a, const Code &b) {
  EXPECT_EQ(a.entry, b.entry);
  EXPECT_EQ(a.binary, b.binary);
  // Each fact as bytes.
  auto bytesOf = [](const Code &code) {
    Code facts;
    facts.schedule = code.schedule;
    Writer out;
    writeCode(out, facts);
    return out.bytes;
  };
  EXPECT_EQ(bytesOf(a), bytesOf(b));
  EXPECT_EQ(a.schedule.cost, b.schedule.cost);
  EXPECT_EQ(a.schedule.tensorMaps.size(), b.schedule.tensorMaps.size());
  EXPECT_EQ(a.schedule.sums.size(), b.schedule.sums.size());
  EXPECT_EQ(a.schedule.copied.list.size(), b.schedule.copied.list.size());
  ASSERT_EQ(a.sites.size(), b.sites.size());
  for (size_t i = 0; i < a.sites.size(); ++i) {
    EXPECT_EQ(a.sites[i].kernel, b.sites[i].kernel);
    EXPECT_EQ(a.sites[i].file, b.sites[i].file);
    EXPECT_EQ(a.sites[i].array, b.sites[i].array);
    EXPECT_EQ(a.sites[i].line, b.sites[i].line);
    EXPECT_EQ(a.sites[i].column, b.sites[i].column);
  }
}

std::string lastNotice;
int noticeCount = 0;

class KernelCacheTest : public testing::Test {
protected:
  void SetUp() override {
    char name[] = "/tmp/warp-cache-test-XXXXXX";
    folder = mkdtemp(name);
    lastNotice.clear();
    noticeCount = 0;
    setNoticeHandler([](const char *message) {
      lastNotice = message;
      ++noticeCount;
    });
  }
  void TearDown() override {
    chmod(folder.c_str(), 0777);
    fs::remove_all(folder);
  }
  std::vector<std::string> files() {
    std::vector<std::string> names;
    for (const auto &entry : fs::directory_iterator(folder))
      names.push_back(entry.path().filename());
    return names;
  }
  void write(const std::string &name, const std::string &bytes) {
    std::ofstream(folder + "/" + name, std::ios::binary) << bytes;
  }

  std::string folder;
};

} // namespace

TEST_F(KernelCacheTest, ReturnsWhatWasStored) {
  KernelCache cache(folder);
  EXPECT_FALSE(cache.find(keyOf('a')));
  cache.store(keyOf('a'), sampleCode());
  auto found = KernelCache(folder).find(keyOf('a'));
  ASSERT_TRUE(found);
  expectSame(*found, sampleCode());
  EXPECT_FALSE(cache.find(keyOf('b')));
  EXPECT_EQ(noticeCount, 0);
}

TEST_F(KernelCacheTest, MakesItsFolder) {
  KernelCache cache(folder + "/a/b");
  cache.store(keyOf('a'), sampleCode());
  EXPECT_TRUE(cache.find(keyOf('a')));
}

TEST_F(KernelCacheTest, SurvivesARemovedFolder) {
  KernelCache cache(folder + "/sub");
  cache.store(keyOf('a'), sampleCode());
  fs::remove_all(folder + "/sub");
  cache.store(keyOf('b'), sampleCode());
  EXPECT_TRUE(cache.find(keyOf('b')));
  EXPECT_EQ(noticeCount, 0);
}

TEST_F(KernelCacheTest, ClearRemovesEntriesOnly) {
  KernelCache cache(folder);
  cache.store(keyOf('a'), sampleCode());
  cache.store(keyOf('b'), sampleCode());
  write("notes.txt", "mine");
  EXPECT_EQ(cache.clear(), 2);
  EXPECT_FALSE(cache.find(keyOf('a')));
  EXPECT_EQ(files(), std::vector<std::string>{"notes.txt"});
}

static void setUsed(const std::string &file, int64_t secondsAgo) {
  timespec then{time(nullptr) - secondsAgo, 0};
  timespec times[] = {then, then};
  ASSERT_EQ(utimensat(AT_FDCWD, file.c_str(), times, 0), 0);
}

// An entry that is found counts as used; foreign files do not count.
TEST_F(KernelCacheTest, TheLeastUsedGoesFirst) {
  KernelCache cache(folder);
  for (char digit : {'a', 'b', 'c', 'd'}) {
    cache.store(keyOf(digit), sampleCode(100'000));
    setUsed(folder + "/" + keyOf(digit) + ".code", 86400 - digit);
  }
  write("notes.txt", std::string(1'000'000, ' '));
  ASSERT_TRUE(cache.find(keyOf('a')));
  std::vector<CacheEntry> entries = cache.entries();
  ASSERT_EQ(entries.size(), 4u);
  EXPECT_EQ(entries[0].file, keyOf('a') + ".code");
  EXPECT_EQ(entries[3].file, keyOf('b') + ".code");
  EXPECT_EQ(entries[0].kernel, "saxpy_cpu");
  EXPECT_EQ(entries[0].kind, "code");
  EXPECT_GT(entries[0].bytes, 100'000);
  EXPECT_EQ(cache.trim(), 0);
  cache.setLimit(3 * entries[0].bytes);
  // Nine tenths of three are two.
  EXPECT_EQ(cache.trim(), 2 * entries[0].bytes);
  EXPECT_TRUE(cache.find(keyOf('a')));
  EXPECT_FALSE(cache.find(keyOf('b')));
  EXPECT_FALSE(cache.find(keyOf('c')));
  EXPECT_TRUE(cache.find(keyOf('d')));
  EXPECT_TRUE(fs::exists(folder + "/notes.txt"));
}

// Writing keeps the folder below the limit.
TEST_F(KernelCacheTest, StaysWithinItsLimit) {
  KernelCache cache(folder);
  cache.setLimit(1'000'000);
  for (char digit = '0'; digit <= '9'; ++digit)
    for (char other = 'a'; other < 'd'; ++other) {
      std::string key = std::string(32, digit) + std::string(32, other);
      cache.store(key, sampleCode(100'000));
    }
  int64_t total = 0;
  for (const CacheEntry &entry : cache.entries(/*named=*/false))
    total += entry.bytes;
  EXPECT_LE(total, 1'250'000);
  EXPECT_GE(total, 500'000);
  cache.setLimit(0);
  EXPECT_EQ(cache.trim(), 0);
}

TEST_F(KernelCacheTest, DisabledDoesNothing) {
  KernelCache cache(folder);
  cache.setEnabled(false);
  cache.store(keyOf('a'), sampleCode());
  EXPECT_TRUE(files().empty());
}

// Every truncation is noticed, and the entry is removed.
TEST_F(KernelCacheTest, RejectsTruncation) {
  std::string bytes = serialize(keyOf('a'), sampleCode(300));
  for (size_t size = 0; size < bytes.size(); ++size)
    ASSERT_FALSE(deserialize(keyOf('a'), bytes.substr(0, size))) << size;
  EXPECT_FALSE(deserialize(keyOf('a'), bytes + "x"));
  KernelCache cache(folder);
  write(keyOf('a') + ".code", bytes.substr(0, bytes.size() / 2));
  EXPECT_FALSE(cache.find(keyOf('a')));
  EXPECT_TRUE(files().empty());
}

// So is every changed bit.
TEST_F(KernelCacheTest, RejectsCorruption) {
  std::string bytes = serialize(keyOf('a'), sampleCode(300));
  for (size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      std::string changed = bytes;
      changed[i] = static_cast<char>(changed[i] ^ 1 << bit);
      ASSERT_FALSE(deserialize(keyOf('a'), changed)) << i << "." << bit;
    }
}

TEST_F(KernelCacheTest, RejectsForeignEntries) {
  std::string bytes = serialize(keyOf('a'), sampleCode());
  EXPECT_FALSE(deserialize(keyOf('b'), bytes));
  KernelCache cache(folder);
  write(keyOf('b') + ".code", bytes);
  write(keyOf('c') + ".code", "not ours at all");
  write(keyOf('d') + ".code", "");
  EXPECT_FALSE(cache.find(keyOf('b')));
  EXPECT_FALSE(cache.find(keyOf('c')));
  EXPECT_FALSE(cache.find(keyOf('d')));
  EXPECT_TRUE(files().empty());
  // The replacements are found again.
  cache.store(keyOf('b'), sampleCode());
  EXPECT_TRUE(cache.find(keyOf('b')));
}

TEST_F(KernelCacheTest, UnwritableFolderGivesOneNotice) {
  // A file in the way stops root too, which permissions do not.
  write("file", "in the way");
  KernelCache cache(folder + "/file/sub");
  cache.store(keyOf('a'), sampleCode());
  cache.store(keyOf('b'), sampleCode());
  EXPECT_FALSE(cache.find(keyOf('a')));
  EXPECT_EQ(noticeCount, 1);
  EXPECT_NE(lastNotice.find("is not writable"), std::string::npos);
}

// Many processes write one entry at once; a reader sees all of it or nothing.
TEST_F(KernelCacheTest, SixteenProcesses) {
  std::vector<pid_t> children;
  for (int i = 0; i < 16; ++i) {
    pid_t child = fork();
    if (child == 0) {
      KernelCache cache(folder);
      bool good = true;
      for (int round = 0; round < 30; ++round) {
        cache.store(keyOf('a'), sampleCode(200000));
        auto found = cache.find(keyOf('a'));
        good = good && found && found->binary == sampleCode(200000).binary;
      }
      _exit(good && noticeCount == 0 ? 0 : 1);
    }
    children.push_back(child);
  }
  for (pid_t child : children) {
    int status = -1;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0);
  }
  EXPECT_EQ(files().size(), 1u);
}

// A writer killed at any moment leaves nothing that a reader would take.
TEST_F(KernelCacheTest, KilledWriter) {
  for (int round = 0; round < 30; ++round) {
    pid_t child = fork();
    if (child == 0) {
      KernelCache cache(folder);
      while (true)
        cache.store(keyOf('a'), sampleCode(1000000));
    }
    usleep(1000 + round * 700);
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    if (auto found = KernelCache(folder).find(keyOf('a'))) {
      EXPECT_EQ(found->binary, sampleCode(1000000).binary);
    }
  }
  KernelCache cache(folder);
  cache.store(keyOf('a'), sampleCode());
  ASSERT_TRUE(cache.find(keyOf('a')));
  EXPECT_EQ(cache.clear(), 1);
  EXPECT_TRUE(files().empty());
}

namespace {
/// The process's cache in a folder of its own, and the time that a claim takes.
class KernelClaims : public testing::Test {
protected:
  void SetUp() override {
    before = KernelCache::get().directory();
    folder =
        fs::path(testing::TempDir()) / ("claims" + std::to_string(getpid()));
    KernelCache::get().setDirectory(folder);
    // Other tests turn it off.
    KernelCache::get().setEnabled(true);
  }
  void TearDown() override {
    KernelCache::get().setDirectory(before);
    KernelCache::get().setEnabled(false);
    fs::remove_all(folder);
  }
  fs::path file() const { return folder / (keyOf('c') + claimSuffix); }

  double secondsToClaim(bool &waited) {
    auto start = std::chrono::steady_clock::now();
    KernelClaim claim(keyOf('c'));
    waited = claim.hasWaited();
    std::chrono::duration<double> time =
        std::chrono::steady_clock::now() - start;
    return time.count();
  }

  std::string before;
  fs::path folder;
};
} // namespace

// The first has the claim; a second process waits until it is given up.
TEST_F(KernelClaims, LetOthersWait) {
  auto claim = std::make_unique<KernelClaim>(keyOf('c'));
  EXPECT_FALSE(claim->hasWaited());
  EXPECT_TRUE(fs::exists(file()));
  pid_t child = fork();
  if (child == 0) {
    bool waited = false;
    double seconds = secondsToClaim(waited);
    _exit(waited && seconds > 0.05 && seconds < 1.5 ? 0 : 1);
  }
  usleep(200'000);
  claim.reset();
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  EXPECT_FALSE(fs::exists(file()));
}

// Claims of processes that are gone, and old ones, hold nobody up.
TEST_F(KernelClaims, EndWithTheirProcess) {
  bool waited = false;
  pid_t child = fork();
  if (child == 0) {
    auto *claim = new KernelClaim(keyOf('c'));
    _exit(claim->hasWaited());
  }
  waitpid(child, nullptr, 0);
  EXPECT_TRUE(fs::exists(file()));
  EXPECT_LT(secondsToClaim(waited), 0.5);
  EXPECT_TRUE(waited);
  std::ofstream(file()) << "1 another-host\n";
  fs::last_write_time(file(), fs::file_time_type::clock::now() -
                                  std::chrono::seconds(5));
  EXPECT_LT(secondsToClaim(waited), 0.5);
}

// A process that has waited lets others claim first, until it has compiled.
TEST_F(KernelClaims, LetWarmProcessesGoFirst) {
  pid_t child = fork();
  if (child == 0) {
    KernelClaim::forgetWork();
    fs::create_directories(folder);
    {
      std::ofstream(file()) << "1 another-host\n";
    }
    fs::last_write_time(file(), fs::file_time_type::clock::now() -
                                    std::chrono::seconds(5));
    bool waited = false;
    secondsToClaim(waited);
    bool isPolite = secondsToClaim(waited) > 0.015 && waited;
    {
      // It compiles.
      KernelClaim claim(keyOf('c'));
      usleep(5'000);
    }
    bool isPrompt = secondsToClaim(waited) < 0.015 && !waited;
    _exit(isPolite && isPrompt ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
}
