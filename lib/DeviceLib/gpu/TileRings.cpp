//===- TileRings.cpp - Tiles that the copy engine brings ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The copy engine (PTX ISA, asynchronous bulk copies) takes boxes of arrays
// that it has maps of (warp/TensorMaps.h) to places in the block's memory that
// threads use in turn, a ring. Each place has two barriers of 8 bytes: `full`
// ends a phase when all bytes of a turn are there, `empty`, behind those of all
// places, when every warp, or warpgroup, has read them. One thread asks for
// copies.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

namespace {

WARP_INLINE void await(u64 barrier, i32 phase) {
  asm volatile("{\n"
               ".reg .pred done;\n"
               "again:\n"
               "mbarrier.try_wait.parity.shared::cta.b64 done, [%0], %1;\n"
               "@!done bra again;\n"
               "}" ::"r"(u32(barrier)),
               "r"(phase)
               : "memory");
}

} // namespace

/// Before all threads meet: `readers` will say that they have read a place.
WARP_TILES warp_tile_open_ring(u64 ring, i32 places, i32 readers, void *) {
  if (threadNumber() != 0)
    return;
  for (i32 i = 0; i < 2 * places; ++i)
    asm volatile(
        "mbarrier.init.shared::cta.b64 [%0], %1;" ::"r"(u32(ring) + 8 * i),
        "r"(i < places ? 1 : readers)
        : "memory");
  asm volatile("fence.mbarrier_init.release.cluster;" ::: "memory");
}

/// When all threads have met for the last time.
WARP_TILES warp_tile_close_ring(u64 ring, i32 places, void *) {
  if (threadNumber() != 0)
    return;
  for (i32 i = 0; i < 2 * places; ++i)
    asm volatile("mbarrier.inval.shared::cta.b64 [%0];" ::"r"(u32(ring) + 8 * i)
                 : "memory");
}

/// So many bytes are about to be copied.
WARP_TILES warp_tile_expect_bytes(u64 full, i32 bytes, void *) {
  asm volatile(
      "mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;" ::"r"(u32(full)),
      "r"(bytes)
      : "memory");
}

/// So many columns at a time, of elements of so many bytes.
WARP_TILES warp_tile_copy_box(u64 to, u64 map, i32 firstRow, i32 firstColumn,
                              i32 rows, i32 columns, i32 width, i32 bytes,
                              u64 full, void *) {
  for (i32 column = 0; column < columns; column += width)
    asm volatile(
        "cp.async.bulk.tensor.2d.shared::cluster.global.tile"
        ".mbarrier::complete_tx::bytes [%0], [%1, {%2, %3}], [%4];" ::"r"(
            u32(to) + column * rows * bytes),
        "l"(map), "r"(firstColumn + column), "r"(firstRow), "r"(u32(full))
        : "memory");
}

/// Until a barrier has ended a phase, which count 0, 1, 0, ...
WARP_TILES warp_tile_await_phase(u64 barrier, i32 phase, void *) {
  await(barrier, phase);
}

/// For a warp or a warpgroup, of so many threads, that has read a place.
WARP_TILES warp_tile_leave_place(u64 empty, i32 team, void *) {
  if (team == 32)
    asm volatile("bar.warp.sync -1;" ::: "memory");
  if (u32(threadNumber()) % u32(team) == 0)
    asm volatile("mbarrier.arrive.shared::cta.b64 _, [%0];" ::"r"(u32(empty))
                 : "memory");
}
