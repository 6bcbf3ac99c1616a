; ModuleID = 'k'
source_filename = "k"
target datalayout = "e-m:e-p270:32:32-p271:32:32-p272:64:64-i64:64-i128:128-f80:128-n8:16:32:64-S128"
target triple = "x86_64-unknown-linux-gnu"

; Function Attrs: nounwind
define void @k(ptr noalias readonly %0, i64 %1, i64 %2) #0 {
  %4 = getelementptr inbounds i8, ptr %0, i32 24
  %5 = load ptr, ptr %4, align 8, !invariant.load !1
  %6 = getelementptr inbounds i8, ptr %0, i32 40
  %7 = load i32, ptr %6, align 4, !invariant.load !1
  %8 = getelementptr inbounds i8, ptr %0, i32 56
  %9 = load i32, ptr %8, align 4, !invariant.load !1
  %10 = sext i32 %9 to i64
  br label %11

11:                                               ; preds = %3
  %12 = call i64 @llvm.smax.i64(i64 %1, i64 %2)
  %13 = sub nuw nsw i64 %12, %1
  %14 = and i64 %13, -16
  %15 = add nuw nsw i64 %1, %14
  br label %16

16:                                               ; preds = %19, %11
  %17 = phi i64 [ %38, %19 ], [ %1, %11 ]
  %18 = icmp slt i64 %17, %15
  br i1 %18, label %19, label %39

19:                                               ; preds = %16
  %20 = trunc nuw nsw i64 %17 to i32
  %21 = insertelement <16 x i32> poison, i32 %20, i32 0
  %22 = shufflevector <16 x i32> %21, <16 x i32> poison, <16 x i32> zeroinitializer
  %23 = add <16 x i32> %22, <i32 0, i32 1, i32 2, i32 3, i32 4, i32 5, i32 6, i32 7, i32 8, i32 9, i32 10, i32 11, i32 12, i32 13, i32 14, i32 15>
  %24 = sext <16 x i32> %23 to <16 x i64>
  %25 = insertelement <16 x i64> poison, i64 %10, i32 0
  %26 = shufflevector <16 x i64> %25, <16 x i64> poison, <16 x i32> zeroinitializer
  %27 = mul <16 x i64> %24, %26
  %28 = getelementptr i8, ptr %5, <16 x i64> %27
  %29 = getelementptr inbounds i8, <16 x ptr> %28, i32 0
  %30 = call <16 x float> @llvm.masked.gather.v16f32.v16p0(<16 x ptr> align 4 %29, <16 x i1> splat (i1 true), <16 x float> zeroinitializer)
  %31 = fmul <16 x float> %30, %30
  %32 = sext <16 x i32> %23 to <16 x i64>
  %33 = insertelement <16 x i64> poison, i64 %10, i32 0
  %34 = shufflevector <16 x i64> %33, <16 x i64> poison, <16 x i32> zeroinitializer
  %35 = mul <16 x i64> %32, %34
  %36 = getelementptr i8, ptr %5, <16 x i64> %35
  %37 = getelementptr inbounds i8, <16 x ptr> %36, i32 0
  call void @llvm.masked.scatter.v16f32.v16p0(<16 x float> %31, <16 x ptr> align 4 %37, <16 x i1> splat (i1 true))
  %38 = add i64 %17, 16
  br label %16

39:                                               ; preds = %16
  %40 = icmp slt i64 %15, %12
  br i1 %40, label %41, label %65

41:                                               ; preds = %39
  %42 = sub nuw nsw i64 %12, %15
  %43 = trunc nuw nsw i64 %42 to i32
  %44 = insertelement <16 x i32> poison, i32 %43, i32 0
  %45 = shufflevector <16 x i32> %44, <16 x i32> poison, <16 x i32> zeroinitializer
  %46 = icmp sgt <16 x i32> %45, <i32 0, i32 1, i32 2, i32 3, i32 4, i32 5, i32 6, i32 7, i32 8, i32 9, i32 10, i32 11, i32 12, i32 13, i32 14, i32 15>
  %47 = trunc nuw nsw i64 %15 to i32
  %48 = insertelement <16 x i32> poison, i32 %47, i32 0
  %49 = shufflevector <16 x i32> %48, <16 x i32> poison, <16 x i32> zeroinitializer
  %50 = add <16 x i32> %49, <i32 0, i32 1, i32 2, i32 3, i32 4, i32 5, i32 6, i32 7, i32 8, i32 9, i32 10, i32 11, i32 12, i32 13, i32 14, i32 15>
  %51 = sext <16 x i32> %50 to <16 x i64>
  %52 = insertelement <16 x i64> poison, i64 %10, i32 0
  %53 = shufflevector <16 x i64> %52, <16 x i64> poison, <16 x i32> zeroinitializer
  %54 = mul <16 x i64> %51, %53
  %55 = getelementptr i8, ptr %5, <16 x i64> %54
  %56 = getelementptr i8, <16 x ptr> %55, i32 0
  %57 = call <16 x float> @llvm.masked.gather.v16f32.v16p0(<16 x ptr> align 4 %56, <16 x i1> %46, <16 x float> zeroinitializer)
  %58 = fmul <16 x float> %57, %57
  %59 = sext <16 x i32> %50 to <16 x i64>
  %60 = insertelement <16 x i64> poison, i64 %10, i32 0
  %61 = shufflevector <16 x i64> %60, <16 x i64> poison, <16 x i32> zeroinitializer
  %62 = mul <16 x i64> %59, %61
  %63 = getelementptr i8, ptr %5, <16 x i64> %62
  %64 = getelementptr i8, <16 x ptr> %63, i32 0
  call void @llvm.masked.scatter.v16f32.v16p0(<16 x float> %58, <16 x ptr> align 4 %64, <16 x i1> %46)
  br label %65

65:                                               ; preds = %41, %39
  br label %66

66:                                               ; preds = %65
  ret void
}

; Function Attrs: nocallback nocreateundeforpoison nofree nosync nounwind speculatable willreturn memory(none)
declare i64 @llvm.smax.i64(i64, i64) #1

; Function Attrs: nocallback nofree nosync nounwind willreturn memory(read)
declare <16 x float> @llvm.masked.gather.v16f32.v16p0(<16 x ptr>, <16 x i1>, <16 x float>) #2

; Function Attrs: nocallback nofree nosync nounwind willreturn memory(write)
declare void @llvm.masked.scatter.v16f32.v16p0(<16 x float>, <16 x ptr>, <16 x i1>) #3

attributes #0 = { nounwind }
attributes #1 = { nocallback nocreateundeforpoison nofree nosync nounwind speculatable willreturn memory(none) }
attributes #2 = { nocallback nofree nosync nounwind willreturn memory(read) }
attributes #3 = { nocallback nofree nosync nounwind willreturn memory(write) }

!llvm.module.flags = !{!0}

!0 = !{i32 2, !"Debug Info Version", i32 3}
!1 = !{}
