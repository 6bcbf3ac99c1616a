module {
  llvm.func @k(%arg0: !llvm.ptr {llvm.noalias, llvm.readonly}, %arg1: i64, %arg2: i64) attributes {warp.arg_types = [!warp.array<1 x f32>], warp.entry, warp.recipe = #warp.recipe<cost = 6, lanes = 16>, warp.schedule = [["lanes", "16", "worth it", 0]], warp.variant = #warp.variant<target = <platform = cpu, bits = 256>>} {
    %0 = llvm.mlir.constant(dense<true> : vector<16xi1>) : vector<16xi1>
    %1 = llvm.mlir.constant(16 : i64) : i64
    %2 = llvm.mlir.constant(-16 : i64) : i64
    %3 = llvm.getelementptr inbounds %arg0[24] : (!llvm.ptr) -> !llvm.ptr, i8
    %4 = llvm.load %3 invariant {alignment = 8 : i64} : !llvm.ptr -> !llvm.ptr
    %5 = llvm.getelementptr inbounds %arg0[40] : (!llvm.ptr) -> !llvm.ptr, i8
    %6 = llvm.load %5 invariant {alignment = 4 : i64, warp.non_negative} : !llvm.ptr -> i32
    %7 = llvm.getelementptr inbounds %arg0[56] : (!llvm.ptr) -> !llvm.ptr, i8
    %8 = llvm.load %7 invariant {alignment = 4 : i64} : !llvm.ptr -> i32
    %9 = llvm.sext %8 : i32 to i64
    llvm.br ^bb1
  ^bb1:  // pred: ^bb0
    %10 = llvm.intr.smax(%arg1, %arg2) : (i64, i64) -> i64
    %11 = llvm.sub %10, %arg1 overflow<nsw, nuw> : i64
    %12 = llvm.and %11, %2 : i64
    %13 = llvm.add %arg1, %12 overflow<nsw, nuw> : i64
    llvm.br ^bb2(%arg1 : i64)
  ^bb2(%14: i64):  // 2 preds: ^bb1, ^bb3
    %15 = llvm.icmp "slt" %14, %13 : i64
    llvm.cond_br %15, ^bb3, ^bb4
  ^bb3:  // pred: ^bb2
    %16 = llvm.trunc %14 overflow<nsw, nuw> : i64 to i32
    %17 = llvm.mlir.constant(dense<[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]> : vector<16xi32>) : vector<16xi32>
    %18 = llvm.mlir.poison : vector<16xi32>
    %19 = llvm.mlir.constant(0 : i32) : i32
    %20 = llvm.insertelement %16, %18[%19 : i32] : vector<16xi32>
    %21 = llvm.shufflevector %20, %18 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi32> 
    %22 = llvm.add %21, %17 : vector<16xi32>
    %23 = llvm.mlir.constant(dense<0> : vector<16xi64>) : vector<16xi64>
    %24 = llvm.sext %22 : vector<16xi32> to vector<16xi64>
    %25 = llvm.mlir.poison : vector<16xi64>
    %26 = llvm.mlir.constant(0 : i32) : i32
    %27 = llvm.insertelement %9, %25[%26 : i32] : vector<16xi64>
    %28 = llvm.shufflevector %27, %25 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
    %29 = llvm.mul %24, %28 : vector<16xi64>
    %30 = llvm.getelementptr %4[%29] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
    %31 = llvm.mlir.constant(dense<0.000000e+00> : vector<16xf32>) : vector<16xf32>
    %32 = llvm.getelementptr inbounds %30[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
    %33 = llvm.intr.masked.gather %32, %0, %31 {alignment = 4 : i32} : (vector<16x!llvm.ptr>, vector<16xi1>, vector<16xf32>) -> vector<16xf32>
    %34 = llvm.fmul %33, %33 : vector<16xf32>
    %35 = llvm.mlir.constant(dense<0> : vector<16xi64>) : vector<16xi64>
    %36 = llvm.sext %22 : vector<16xi32> to vector<16xi64>
    %37 = llvm.mlir.poison : vector<16xi64>
    %38 = llvm.mlir.constant(0 : i32) : i32
    %39 = llvm.insertelement %9, %37[%38 : i32] : vector<16xi64>
    %40 = llvm.shufflevector %39, %37 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
    %41 = llvm.mul %36, %40 : vector<16xi64>
    %42 = llvm.getelementptr %4[%41] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
    %43 = llvm.getelementptr inbounds %42[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
    llvm.intr.masked.scatter %34, %43, %0 {alignment = 4 : i32} : vector<16xf32>, vector<16xi1> into vector<16x!llvm.ptr>
    %44 = llvm.add %14, %1 : i64
    llvm.br ^bb2(%44 : i64)
  ^bb4:  // pred: ^bb2
    %45 = llvm.icmp "slt" %13, %10 : i64
    llvm.cond_br %45, ^bb5, ^bb6
  ^bb5:  // pred: ^bb4
    %46 = llvm.sub %10, %13 overflow<nsw, nuw> : i64
    %47 = llvm.mlir.constant(dense<[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]> : vector<16xi32>) : vector<16xi32>
    %48 = llvm.trunc %46 overflow<nsw, nuw> : i64 to i32
    %49 = llvm.mlir.poison : vector<16xi32>
    %50 = llvm.mlir.constant(0 : i32) : i32
    %51 = llvm.insertelement %48, %49[%50 : i32] : vector<16xi32>
    %52 = llvm.shufflevector %51, %49 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi32> 
    %53 = llvm.icmp "sgt" %52, %47 : vector<16xi32>
    %54 = llvm.trunc %13 overflow<nsw, nuw> : i64 to i32
    %55 = llvm.mlir.constant(dense<[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]> : vector<16xi32>) : vector<16xi32>
    %56 = llvm.mlir.poison : vector<16xi32>
    %57 = llvm.mlir.constant(0 : i32) : i32
    %58 = llvm.insertelement %54, %56[%57 : i32] : vector<16xi32>
    %59 = llvm.shufflevector %58, %56 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi32> 
    %60 = llvm.add %59, %55 : vector<16xi32>
    %61 = llvm.mlir.constant(dense<0> : vector<16xi64>) : vector<16xi64>
    %62 = llvm.sext %60 : vector<16xi32> to vector<16xi64>
    %63 = llvm.mlir.poison : vector<16xi64>
    %64 = llvm.mlir.constant(0 : i32) : i32
    %65 = llvm.insertelement %9, %63[%64 : i32] : vector<16xi64>
    %66 = llvm.shufflevector %65, %63 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
    %67 = llvm.mul %62, %66 : vector<16xi64>
    %68 = llvm.getelementptr %4[%67] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
    %69 = llvm.mlir.constant(dense<0.000000e+00> : vector<16xf32>) : vector<16xf32>
    %70 = llvm.getelementptr %68[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
    %71 = llvm.intr.masked.gather %70, %53, %69 {alignment = 4 : i32} : (vector<16x!llvm.ptr>, vector<16xi1>, vector<16xf32>) -> vector<16xf32>
    %72 = llvm.fmul %71, %71 : vector<16xf32>
    %73 = llvm.mlir.constant(dense<0> : vector<16xi64>) : vector<16xi64>
    %74 = llvm.sext %60 : vector<16xi32> to vector<16xi64>
    %75 = llvm.mlir.poison : vector<16xi64>
    %76 = llvm.mlir.constant(0 : i32) : i32
    %77 = llvm.insertelement %9, %75[%76 : i32] : vector<16xi64>
    %78 = llvm.shufflevector %77, %75 [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] : vector<16xi64> 
    %79 = llvm.mul %74, %78 : vector<16xi64>
    %80 = llvm.getelementptr %4[%79] : (!llvm.ptr, vector<16xi64>) -> vector<16x!llvm.ptr>, i8
    %81 = llvm.getelementptr %80[0] : (vector<16x!llvm.ptr>) -> vector<16x!llvm.ptr>, i8
    llvm.intr.masked.scatter %72, %81, %53 {alignment = 4 : i32} : vector<16xf32>, vector<16xi1> into vector<16x!llvm.ptr>
    llvm.br ^bb6
  ^bb6:  // 2 preds: ^bb4, ^bb5
    llvm.br ^bb7
  ^bb7:  // pred: ^bb6
    llvm.return
  }
}
