module {
  llvm.func @k(%arg0: !llvm.ptr {llvm.noalias, llvm.readonly}, %arg1: i64, %arg2: i64) attributes {warp.arg_types = [!warp.array<1 x f32>], warp.entry, warp.recipe = #warp.recipe<cost = 6, lanes = 16>, warp.schedule = [["lanes", "16", "worth it", 0]], warp.variant = #warp.variant<target = <platform = cpu, bits = 256>>} {
    %cst = arith.constant dense<true> : vector<16xi1>
    %c16_i64 = arith.constant 16 : i64
    %c-16_i64 = arith.constant -16 : i64
    %0 = llvm.getelementptr inbounds %arg0[24] : (!llvm.ptr) -> !llvm.ptr, i8
    %1 = llvm.load %0 invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr
    %2 = llvm.getelementptr inbounds %arg0[40] : (!llvm.ptr) -> !llvm.ptr, i8
    %3 = llvm.load %2 invariant {alignment = 4 : i64, warp.non_negative} : !llvm.ptr -> i32
    %4 = llvm.getelementptr inbounds %arg0[56] : (!llvm.ptr) -> !llvm.ptr, i8
    %5 = llvm.load %4 invariant {alignment = 4 : i64} : !llvm.ptr -> i32
    %6 = arith.extsi %5 : i32 to i64
    llvm.br ^bb1
  ^bb1:  // pred: ^bb0
    %7 = arith.maxsi %arg1, %arg2 : i64
    %8 = arith.subi %7, %arg1 overflow<nsw, nuw> : i64
    %9 = arith.andi %8, %c-16_i64 : i64
    %10 = arith.addi %arg1, %9 overflow<nsw, nuw> : i64
    scf.for %arg3 = %arg1 to %10 step %c16_i64  : i64 {
      %12 = arith.trunci %arg3 overflow<nsw, nuw> : i64 to i32
      %cst_0 = arith.constant dense<[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]> : vector<16xi32>
      %13 = llvm.mlir.poison : vector<16xi32>
      %c0_i32 = arith.constant 0 : i32
      %14 = llvm.insertelement %12, %13[%c0_i32 : i32] : vector<16xi32>
      %15 = llvm.shufflevector %14, %13 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi32> 
      %16 = arith.addi %15, %cst_0 : vector<16xi32>
      %cst_1 = arith.constant dense<0> : vector<16xi64>
      %17 = arith.extsi %16 : vector<16xi32> to vector<16xi64>
      %18 = llvm.mlir.poison : vector<16xi64>
      %c0_i32_2 = arith.constant 0 : i32
      %19 = llvm.insertelement %6, %18[%c0_i32_2 : i32] : vector<16xi64>
      %20 = llvm.shufflevector %19, %18 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
      %21 = arith.muli %17, %20 : vector<16xi64>
      %22 = llvm.getelementptr %1[%21] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
      %cst_3 = arith.constant dense<0.000000e+00> : vector<16xf32>
      %23 = llvm.getelementptr inbounds %22[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
      %24 = llvm.intr.masked.gather %23, %cst, %cst_3 {alignment = 4 : i32} : (vector<16x!llvm.ptr>, vector<16xi1>, vector<16xf32>) -> vector<16xf32>
      %25 = arith.mulf %24, %24 : vector<16xf32>
      %cst_4 = arith.constant dense<0> : vector<16xi64>
      %26 = arith.extsi %16 : vector<16xi32> to vector<16xi64>
      %27 = llvm.mlir.poison : vector<16xi64>
      %c0_i32_5 = arith.constant 0 : i32
      %28 = llvm.insertelement %6, %27[%c0_i32_5 : i32] : vector<16xi64>
      %29 = llvm.shufflevector %28, %27 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
      %30 = arith.muli %26, %29 : vector<16xi64>
      %31 = llvm.getelementptr %1[%30] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
      %32 = llvm.getelementptr inbounds %31[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
      llvm.intr.masked.scatter %25, %32, %cst {alignment = 4 : i32} : vector<16xf32>, vector<16xi1> into vector<16x!llvm.ptr>
    }
    %11 = arith.cmpi slt, %10, %7 : i64
    scf.if %11 {
      %12 = arith.subi %7, %10 overflow<nsw, nuw> : i64
      %cst_0 = arith.constant dense<[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]> : vector<16xi32>
      %13 = arith.trunci %12 overflow<nsw, nuw> : i64 to i32
      %14 = llvm.mlir.poison : vector<16xi32>
      %c0_i32 = arith.constant 0 : i32
      %15 = llvm.insertelement %13, %14[%c0_i32 : i32] : vector<16xi32>
      %16 = llvm.shufflevector %15, %14 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi32> 
      %17 = arith.cmpi slt, %cst_0, %16 : vector<16xi32>
      %18 = arith.trunci %10 overflow<nsw, nuw> : i64 to i32
      %cst_1 = arith.constant dense<[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]> : vector<16xi32>
      %19 = llvm.mlir.poison : vector<16xi32>
      %c0_i32_2 = arith.constant 0 : i32
      %20 = llvm.insertelement %18, %19[%c0_i32_2 : i32] : vector<16xi32>
      %21 = llvm.shufflevector %20, %19 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi32> 
      %22 = arith.addi %21, %cst_1 : vector<16xi32>
      %cst_3 = arith.constant dense<0> : vector<16xi64>
      %23 = arith.extsi %22 : vector<16xi32> to vector<16xi64>
      %24 = llvm.mlir.poison : vector<16xi64>
      %c0_i32_4 = arith.constant 0 : i32
      %25 = llvm.insertelement %6, %24[%c0_i32_4 : i32] : vector<16xi64>
      %26 = llvm.shufflevector %25, %24 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
      %27 = arith.muli %23, %26 : vector<16xi64>
      %28 = llvm.getelementptr %1[%27] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
      %cst_5 = arith.constant dense<0.000000e+00> : vector<16xf32>
      %29 = llvm.getelementptr %28[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
      %30 = llvm.intr.masked.gather %29, %17, %cst_5 {alignment = 4 : i32} : (vector<16x!llvm.ptr>, vector<16xi1>, vector<16xf32>) -> vector<16xf32>
      %31 = arith.mulf %30, %30 : vector<16xf32>
      %cst_6 = arith.constant dense<0> : vector<16xi64>
      %32 = arith.extsi %22 : vector<16xi32> to vector<16xi64>
      %33 = llvm.mlir.poison : vector<16xi64>
      %c0_i32_7 = arith.constant 0 : i32
      %34 = llvm.insertelement %6, %33[%c0_i32_7 : i32] : vector<16xi64>
      %35 = llvm.shufflevector %34, %33 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
      %36 = arith.muli %32, %35 : vector<16xi64>
      %37 = llvm.getelementptr %1[%36] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
      %38 = llvm.getelementptr %37[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
      llvm.intr.masked.scatter %31, %38, %17 {alignment = 4 : i32} : vector<16xf32>, vector<16xi1> into vector<16x!llvm.ptr>
    }
    llvm.br ^bb2
  ^bb2:  // pred: ^bb1
    llvm.return
  }
}
