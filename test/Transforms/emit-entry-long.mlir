// RUN: %python -c "import sys; ops = [f'%a{k} = arith.addf %v, %v : vector<4xf32>' for k in range(int(sys.argv[2]))]; print(open(sys.argv[1]).read().replace('// ' + 'OPERATIONS', chr(10).join(ops)))" %s 500 > %t.long
// RUN: %python -c "import sys; ops = [f'%a{k} = arith.addf %v, %v : vector<4xf32>' for k in range(int(sys.argv[2]))]; print(open(sys.argv[1]).read().replace('// ' + 'OPERATIONS', chr(10).join(ops)))" %s 300 > %t.short
// RUN: warp-opt %t.long --warp-emit-entry | FileCheck %s
// RUN: warp-opt %t.short --warp-emit-entry | FileCheck %s --check-prefix=SHORT

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// A long body is not worth two copies: the mask is always a variable, of the
// threads that are left, or of all lanes.
// CHECK-LABEL: llvm.func @long
// CHECK-NOT: dense<true>
// CHECK: %[[END:.*]] = arith.maxsi %arg1, %arg2
// CHECK: scf.for %[[N:[^ ]+]] = %arg1 to %[[END]] step %[[WIDTH:[^ ]+]]
// CHECK: %[[LEFT:.*]] = arith.subi %[[END]], %[[N]]
// CHECK: %[[COUNT:.*]] = arith.minsi %[[LEFT]], %[[WIDTH]]
// CHECK: %[[MASK:.*]] = arith.cmpi slt, %{{.*}}, %{{.*}} : vector<4xi32>
// CHECK: warp.any %[[MASK]]
// CHECK-NOT: warp.any
// CHECK: llvm.return
// SHORT-LABEL: llvm.func @long
// SHORT: dense<true>
// SHORT: warp.any
// SHORT: warp.any
func.func @long(%a: f32) attributes {warp.kernel, warp.variant = #cpu} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, lanes = 4 : i64, types = []} {
    ^bb0(%i: i32, %live: vector<4xi1>):
      %v = warp.broadcast %a : f32 -> vector<4xf32>
      %any = warp.any %live : vector<4xi1>
// OPERATIONS
      warp.yield
    }
  }
  return
}
