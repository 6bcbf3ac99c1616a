// RUN: warp-opt %s --split-input-file --verify-diagnostics
// RUN: echo "module {}" | not warp-opt --warp-pipeline="to-warp large=perhaps" 2>&1 | FileCheck %s --check-prefix=VALUE
// RUN: echo "module {}" | not warp-opt --warp-pipeline="to-thread lagre" 2>&1 | FileCheck %s --check-prefix=NAME
// RUN: echo "module {}" | not warp-opt --warp-pipeline="to-trhead" 2>&1 | FileCheck %s --check-prefix=PHASE
// RUN: not warp-opt %s --warp-emit=ptx --warp-options=target=sm_90,min-block=1 2>&1 | FileCheck %s --check-prefix=EMIT

// VALUE: option 'large' has no value 'perhaps'
// NAME: no option 'lagre', there are: {{.*}}large{{.*}}
// PHASE: no phase 'trhead', there are: warp, thread, launch, gpu, llvm
// EMIT: no option 'min-block', there are: {{.*}}rank{{.*}}; of derivatives: active, apart

// expected-error @+2 {{(C1) expects a target such as 'cpu', 'sm_90' or 'gfx90a', but got 'sm_'}}
func.func private @no_version() attributes {warp.target =
    #warp.target<name = "sm_">}

// -----

// expected-error @+2 {{(C2) expects vectors of 0 bits for 'sm_90', but got 256}}
func.func private @gpu_vectors() attributes {warp.target =
    #warp.target<name = "sm_90", bits = 256>}

// -----

// expected-error @+2 {{(C2) expects vectors of 128, 256 or 512 bits for 'cpu', but got 0}}
func.func private @no_vectors() attributes {warp.target =
    #warp.target<name = "cpu">}

// -----

// expected-error @+2 {{expects 'rank' to be from 1 to 4, but got '0'}}
func.func private @rank() attributes {warp.variant =
    #warp.variant<target = <name = "sm_90">, rank = 0>}

// -----

// expected-error @+2 {{expects 'block_dim' to be from 1 to 1048576, but got '0'}}
func.func private @block() attributes {warp.variant =
    #warp.variant<target = <name = "sm_90">, block_dim = 0>}

// -----

// expected-error @+2 {{expects 'lanes' to be 0 or a power of two up to 64, but got '12'}}
func.func private @lanes() attributes {warp.variant =
    #warp.variant<target = <name = "cpu", bits = 256>, lanes = 12>}

// -----

// expected-error @+2 {{expects 'inner_extent' to be 0 or a power of two up to 64, but got '5'}}
func.func private @row() attributes {warp.variant =
    #warp.variant<target = <name = "cpu", bits = 256>, inner_extent = 5>}

// -----

// expected-error @+3 {{expected ::warp::HiddenKind to be one of: preserved, saved}}
// expected-error @+2 {{failed to parse Warp_HiddenAttr parameter 'kind'}}
func.func private @kind(
    f32 {warp.hidden = #warp.hidden<kind = unheard, leaf = 0>})
