module {
  gpu.module @saxpy [#rocdl.target<chip = "gfx90a">] attributes {llvm.data_layout = "e-p:64:64-p1:64:64-p2:32:32-p3:32:32-p4:64:64-p5:32:32-p6:32:32-p7:160:256:256:32-p8:128:128:128:48-p9:192:256:256:32-i64:64-v16:16-v24:32-v32:32-v48:64-v96:128-v192:256-v256:256-v512:512-v1024:1024-v2048:2048-n32:64-S32-A5-G1-ni:7:8:9"} {
    llvm.func @saxpy(%arg0: !llvm.ptr {llvm.align = 8 : i64}) attributes {gpu.kernel, rocdl.kernel, warp.arg_types = [!warp.array<1 x f32>, !warp.array<1 x f32>, f32], warp.entry, warp.schedule = [["items", "1", "the launch is not large", 0]], warp.sized, warp.variant = #warp.variant<target = <platform = cuda, version = 90>, contiguous = 3>} {
      %0 = llvm.load %arg0 invariant {alignment = 4 : i64} : !llvm.ptr -> i32
      %1 = llvm.getelementptr inbounds %arg0[24] : (!llvm.ptr) -> !llvm.ptr, i8
      %2 = llvm.load %1 invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr<1>
      %3 = llvm.getelementptr inbounds %arg0[80] : (!llvm.ptr) -> !llvm.ptr, i8
      %4 = llvm.load %3 invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr<1>
      %5 = llvm.getelementptr inbounds %arg0[136] : (!llvm.ptr) -> !llvm.ptr, i8
      %6 = llvm.load %5 invariant {alignment = 4 : i64} : !llvm.ptr -> f32
      llvm.br ^bb1
    ^bb1:  // pred: ^bb0
      %7 = rocdl.workgroup.id.x : i32
      %8 = llvm.sext %7 : i32 to i64
      %9 = llvm.trunc %8 : i64 to i32
      %10 = rocdl.workgroup.dim.x : i32
      %11 = llvm.sext %10 : i32 to i64
      %12 = llvm.trunc %11 : i64 to i32
      %13 = llvm.mul %9, %12 overflow<nsw, nuw> : i32
      %14 = rocdl.workitem.id.x : i32
      %15 = llvm.sext %14 : i32 to i64
      %16 = llvm.trunc %15 : i64 to i32
      %17 = llvm.add %13, %16 overflow<nsw, nuw> : i32
      %18 = llvm.icmp "slt" %17, %0 : i32
      llvm.cond_br %18, ^bb2, ^bb3
    ^bb2:  // pred: ^bb1
      %19 = llvm.sext %17 : i32 to i64
      %20 = llvm.getelementptr inbounds %2[%19] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, f32
      %21 = llvm.load %20 {alignment = 4 : i64} : !llvm.ptr<1> -> f32
      %22 = llvm.sext %17 : i32 to i64
      %23 = llvm.getelementptr inbounds %4[%22] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, f32
      %24 = llvm.load %23 {alignment = 4 : i64} : !llvm.ptr<1> -> f32
      %25 = llvm.intr.fma(%6, %21, %24) : (f32, f32, f32) -> f32
      %26 = llvm.sext %17 : i32 to i64
      %27 = llvm.getelementptr inbounds %4[%26] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, f32
      llvm.store %25, %27 {alignment = 4 : i64} : f32, !llvm.ptr<1>
      llvm.br ^bb3
    ^bb3:  // 2 preds: ^bb1, ^bb2
      llvm.br ^bb4
    ^bb4:  // pred: ^bb3
      llvm.return
    }
  }
}

