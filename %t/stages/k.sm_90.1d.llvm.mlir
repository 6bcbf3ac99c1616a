module {
  llvm.func @k(%arg0: !llvm.ptr {llvm.align = 8 : i64, llvm.byval = !llvm.array<80 x i8>}) attributes {gpu.kernel, nvvm.kernel, nvvm.maxntid = array<i32: 256>, warp.arg_types = [!warp.array<1 x f32>], warp.entry, warp.recipe = #warp.recipe<cost = 6>, warp.schedule = [["items", "1", "the launch is not large", 0]], warp.sized, warp.variant = #warp.variant<target = <platform = cuda, version = 90>>} {
    %0 = llvm.load %arg0 invariant {alignment = 4 : i64} : !llvm.ptr -> i32
    %1 = llvm.getelementptr inbounds %arg0[24] : (!llvm.ptr) -> !llvm.ptr, i8
    %2 = llvm.load %1 invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr<1>
    %3 = llvm.getelementptr inbounds %arg0[40] : (!llvm.ptr) -> !llvm.ptr, i8
    %4 = llvm.load %3 invariant {alignment = 4 : i64, warp.non_negative} : !llvm.ptr -> i32
    %5 = llvm.getelementptr inbounds %arg0[56] : (!llvm.ptr) -> !llvm.ptr, i8
    %6 = llvm.load %5 invariant {alignment = 4 : i64} : !llvm.ptr -> i32
    %7 = llvm.sext %6 : i32 to i64
    llvm.br ^bb1
  ^bb1:  // pred: ^bb0
    %8 = nvvm.read.ptx.sreg.ctaid.x : i32
    %9 = llvm.sext %8 : i32 to i64
    %10 = nvvm.read.ptx.sreg.ntid.x : i32
    %11 = llvm.sext %10 : i32 to i64
    %12 = llvm.mul %8, %10 overflow<nsw, nuw> : i32
    %13 = nvvm.read.ptx.sreg.tid.x : i32
    %14 = llvm.sext %13 : i32 to i64
    %15 = llvm.add %12, %13 overflow<nsw, nuw> : i32
    %16 = llvm.icmp "slt" %15, %0 : i32
    llvm.cond_br %16, ^bb2, ^bb3
  ^bb2:  // pred: ^bb1
    %17 = llvm.sext %8 : i32 to i64
    %18 = llvm.sext %10 : i32 to i64
    %19 = llvm.mul %17, %18 overflow<nsw> : i64
    %20 = llvm.sext %13 : i32 to i64
    %21 = llvm.add %19, %20 overflow<nsw> : i64
    %22 = llvm.mul %21, %7 overflow<nsw> : i64
    %23 = llvm.getelementptr inbounds %2[%22] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, i8
    %24 = llvm.load %23 {alignment = 4 : i64} : !llvm.ptr<1> -> f32
    %25 = llvm.fmul %24, %24 : f32
    %26 = llvm.sext %8 : i32 to i64
    %27 = llvm.sext %10 : i32 to i64
    %28 = llvm.mul %26, %27 overflow<nsw> : i64
    %29 = llvm.sext %13 : i32 to i64
    %30 = llvm.add %28, %29 overflow<nsw> : i64
    %31 = llvm.mul %30, %7 overflow<nsw> : i64
    %32 = llvm.getelementptr inbounds %2[%31] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, i8
    llvm.store %25, %32 {alignment = 4 : i64} : f32, !llvm.ptr<1>
    llvm.br ^bb3
  ^bb3:  // 2 preds: ^bb1, ^bb2
    llvm.br ^bb4
  ^bb4:  // pred: ^bb3
    llvm.return
  }
}
