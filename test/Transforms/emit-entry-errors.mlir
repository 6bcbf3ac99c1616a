// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-emit-entry
// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-plan-updates --warp-combine-over-groups

// Thread IR has no group of threads.
// expected-error @below {{expects a kernel in phase 'launch'}}
func.func @thread(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : i32
  return
}
