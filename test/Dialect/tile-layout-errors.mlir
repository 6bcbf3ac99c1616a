// RUN: warp-opt %s --split-input-file --verify-diagnostics

// expected-error @+2 {{(C1) expects a tile in memory for a pitch, a swizzle, stages or a tensor map, but its storage is 'accumulators'}}
func.func private @pitch_of_registers() attributes {warp.layout =
    #warp.tile_layout<storage = accumulators, pitch = 20>}

// -----

// expected-error @+2 {{(C1) expects a tile in memory for a pitch, a swizzle, stages or a tensor map, but its storage is 'inlined'}}
func.func private @stages_of_nothing() attributes {warp.layout =
    #warp.tile_layout<storage = inlined, stages = 3>}

// -----

// expected-error @+2 {{(C2) expects a pitch and an offset of 0 or more and a stage, but got 0, 0 and 0}}
func.func private @no_stage() attributes {warp.layout =
    #warp.tile_layout<stages = 0>}

// -----

// expected-error @+2 {{(C3) expects barriers with a tensor map only}}
func.func private @barriers_alone() attributes {warp.layout =
    #warp.tile_layout<stages = 3, barriers = true>}

// -----

// expected-error @+2 {{(C4) expects merged steps along axis 0 or 1, of a positive extent}}
func.func private @merged_axis() attributes {warp.layout =
    #warp.tile_layout<merged_axis = 2, merged_extent = 16>}

// -----

// expected-error @+2 {{(C1) expects a name}}
func.func private @no_name() attributes {warp.function =
    #warp.tile_function<name = "">}

// -----

// expected-error @+2 {{(C2) expects slots and a layout of accumulators, or neither}}
func.func private @slots_alone() attributes {warp.function =
    #warp.tile_function<name = "f32_8x8_kn", slots = 64>}

// -----

func.func @not_a_layout(%x: f32) {
  // expected-error @+1 {{expects '#warp.tile_layout' for 'warp.layout'}}
  %t = warp.tile_splat %x {warp.layout = "inlined"} : f32 -> !warp.tile<4 x f32>
  return
}

// -----

func.func @not_a_function(%x: f32) {
  // expected-error @+1 {{expects '#warp.tile_function' for 'warp.function'}}
  %t = warp.tile_splat %x {warp.function = 16 : i64} : f32 -> !warp.tile<4 x f32>
  return
}

// -----

func.func @no_tile(%x: f32, %t: !warp.tile<4 x f32>) {
  // expected-error @+1 {{has a layout, but gives no tile}}
  %y = warp.tile_to_threads %t {warp.layout = #warp.tile_layout<pitch = 4>} : !warp.tile<4 x f32> -> f32
  return
}

// -----

func.func @replicated(%x: f32) {
  // expected-error @+1 {{is replicated, but its tile has more than one element}}
  %t = warp.tile_splat %x {warp.layout = #warp.tile_layout<storage = replicated>} : f32 -> !warp.tile<4 x f32>
  return
}
