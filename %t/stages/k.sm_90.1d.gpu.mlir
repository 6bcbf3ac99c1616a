module {
  gpu.module @k {
    gpu.func @k(%arg0: !llvm.ptr {llvm.align = 8 : i64, llvm.byval = !llvm.array<80 x i8>}) kernel attributes {warp.arg_types = [!warp.array<1 x f32>], warp.entry, warp.recipe = #warp.recipe<cost = 6>, warp.schedule = [["items", "1", "the launch is not large", 0]], warp.sized, warp.variant = #warp.variant<target = <platform = cuda, version = 90>>} {
      %0 = llvm.load %arg0 invariant {alignment = 4 : i64} : !llvm.ptr -> i32
      %1 = llvm.getelementptr inbounds %arg0[24] : (!llvm.ptr) -> !llvm.ptr, i8
      %2 = llvm.load %1 invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr<1>
      %3 = llvm.getelementptr inbounds %arg0[40] : (!llvm.ptr) -> !llvm.ptr, i8
      %4 = llvm.load %3 invariant {alignment = 4 : i64, warp.non_negative} : !llvm.ptr -> i32
      %5 = llvm.getelementptr inbounds %arg0[56] : (!llvm.ptr) -> !llvm.ptr, i8
      %6 = llvm.load %5 invariant {alignment = 4 : i64} : !llvm.ptr -> i32
      %7 = arith.extsi %6 : i32 to i64
      llvm.br ^bb1
    ^bb1:  // pred: ^bb0
      %block_id_x = gpu.block_id  x
      %8 = arith.index_cast %block_id_x : index to i32
      %block_dim_x = gpu.block_dim  x
      %9 = arith.index_cast %block_dim_x : index to i32
      %10 = arith.muli %8, %9 overflow<nsw, nuw> : i32
      %thread_id_x = gpu.thread_id  x
      %11 = arith.index_cast %thread_id_x : index to i32
      %12 = arith.addi %10, %11 overflow<nsw, nuw> : i32
      %13 = arith.cmpi slt, %12, %0 : i32
      scf.if %13 {
        %14 = arith.extsi %8 : i32 to i64
        %15 = arith.extsi %9 : i32 to i64
        %16 = arith.muli %14, %15 overflow<nsw> : i64
        %17 = arith.extsi %11 : i32 to i64
        %18 = arith.addi %16, %17 overflow<nsw> : i64
        %19 = arith.muli %18, %7 overflow<nsw> : i64
        %20 = llvm.getelementptr inbounds %2[%19] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, i8
        %21 = llvm.load %20 {alignment = 4 : i64} : !llvm.ptr<1> -> f32
        %22 = arith.mulf %21, %21 : f32
        %23 = arith.extsi %8 : i32 to i64
        %24 = arith.extsi %9 : i32 to i64
        %25 = arith.muli %23, %24 overflow<nsw> : i64
        %26 = arith.extsi %11 : i32 to i64
        %27 = arith.addi %25, %26 overflow<nsw> : i64
        %28 = arith.muli %27, %7 overflow<nsw> : i64
        %29 = llvm.getelementptr inbounds %2[%28] : (!llvm.ptr<1>, i64) -> !llvm.ptr<1>, i8
        llvm.store %22, %29 {alignment = 4 : i64} : f32, !llvm.ptr<1>
      }
      llvm.br ^bb2
    ^bb2:  // pred: ^bb1
      gpu.return
    }
  }
}
