//===- Support.cpp - Utilities of the runtime -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Support.h"

#include "warp/Forks.h"
#include "warp/KernelCache.h"
#include "warp/Launch.h"

#include <atomic>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <set>

using namespace warp;

std::string warp::formatBytes(uint64_t bytes) {
  static const char *const units[] = {"KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
  if (bytes < 1024)
    return std::to_string(bytes) + " bytes";
  double value = static_cast<double>(bytes) / 1024;
  int unit = 0;
  for (; value >= 1024 && unit < 5; ++unit)
    value /= 1024;
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f %s", value, units[unit]);
  return text;
}

std::string warp::environment(const char *name) {
  const char *value = std::getenv(name);
  return value ? value : "";
}

const char *warp::permanentName(const std::string &name) {
  static ForkMutex mutex;
  static auto *names = new std::set<std::string>;
  std::lock_guard lock(mutex);
  return names->insert(name).first->c_str();
}

static uint64_t mix(uint64_t a, uint64_t b) {
  __uint128_t product = static_cast<__uint128_t>(a) * b;
  return static_cast<uint64_t>(product) ^ static_cast<uint64_t>(product >> 64);
}

uint64_t warp::hashBytes(const void *data, size_t size, uint64_t seed) {
  constexpr uint64_t k0 = 0x9e3779b97f4a7c15, k1 = 0xd6e8feb86659fd93;
  const char *bytes = static_cast<const char *>(data);
  uint64_t hash = mix(seed ^ k0, size ^ k1);
  for (; size >= 8; size -= 8, bytes += 8) {
    uint64_t word;
    std::memcpy(&word, bytes, 8);
    // The sum keeps a word in the hash even where the product is zero.
    hash = mix(hash ^ k0, word ^ k1) + (word ^ (hash << 23 | hash >> 41));
  }
  uint64_t word = 0;
  std::memcpy(&word, bytes, size);
  hash ^= mix(hash ^ k1, word ^ k0) + word;
  hash ^= hash >> 29;
  hash *= k0;
  return hash ^ hash >> 32;
}

static void printNotice(const char *message) {
  std::fprintf(stderr, "warp: %s\n", message);
}

static std::atomic<void (*)(const char *)> noticeHandler{printNotice};

void warp::setNoticeHandler(void (*handler)(const char *)) {
  noticeHandler = handler;
}

void warp::notice(const std::string &message) {
  if (auto *handler = noticeHandler.load())
    handler(message.c_str());
}

int warp_printf(const char *format, ...) {
  va_list arguments;
  va_start(arguments, format);
  int written = std::vprintf(format, arguments);
  va_end(arguments);
  return written;
}
