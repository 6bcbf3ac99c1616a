// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-emit-entry

// Threads of a GPU are mapped to the grid before there is an entry.
func.func @unmapped(%y: !warp.array<1 x si32>) attributes {warp.kernel,
    warp.variant = #warp.variant<target = <name = "sm_90">>} {
  warp.group {
    // expected-error @below {{expects threads that are mapped to the grid, run '--warp-apply-schedules' first}}
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      warp.store_components(%i), %y[%i] : (i32), !warp.array<1 x si32>, i32
      warp.yield
    }
  }
  return
}
