//===- Output.cpp - printf into a buffer of the launch --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A record is the address of the format and the bytes of the arguments, in
// words. Whoever launches sets the buffer, whose first word counts the words
// that are taken, and prints the records afterwards. Records that find no room
// are lost, but counted.
//
//===----------------------------------------------------------------------===//

using u32 = unsigned;
using u64 = unsigned long;

struct OutputBuffer {
  u32 taken, size;
  u32 words[];
};

extern "C" __attribute__((visibility("protected"), used))
__attribute__((address_space(1))) OutputBuffer *warp_output = nullptr;

extern "C" int warp_gpu_printf(const char *format, const u32 *arguments,
                               int bytes) {
  auto *buffer = warp_output;
  if (!buffer)
    return 0;
  u32 count = u32(bytes) / 4, needed = count + 3;
  u32 first = __scoped_atomic_fetch_add(
      &buffer->taken, needed, __ATOMIC_RELAXED, __MEMORY_SCOPE_DEVICE);
  if (first + needed > buffer->size)
    return -1;
  u64 address = u64(format);
  buffer->words[first] = needed;
  buffer->words[first + 1] = u32(address);
  buffer->words[first + 2] = u32(address >> 32);
  for (u32 i = 0; i < count; ++i)
    buffer->words[first + 3 + i] = arguments[i];
  return int(count);
}
