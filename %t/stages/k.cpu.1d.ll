; ModuleID = 'k'
source_filename = "k"
target datalayout = "e-m:e-p270:32:32-p271:32:32-p272:64:64-i64:64-i128:128-f80:128-n8:16:32:64-S128"
target triple = "x86_64-unknown-linux-gnu"

; Function Attrs: nofree norecurse nosync nounwind
define void @k(ptr noalias readonly captures(none) %0, i64 %1, i64 %2) local_unnamed_addr #0 {
  %4 = getelementptr inbounds nuw i8, ptr %0, i64 24
  %5 = load ptr, ptr %4, align 8, !invariant.load !1
  %6 = getelementptr inbounds nuw i8, ptr %0, i64 56
  %7 = load i32, ptr %6, align 8, !invariant.load !1
  %8 = sext i32 %7 to i64
  %9 = tail call i64 @llvm.smax.i64(i64 %1, i64 %2)
  %10 = sub nuw nsw i64 %9, %1
  %11 = and i64 %10, -16
  %12 = add nuw nsw i64 %11, %1
  %13 = icmp sgt i64 %10, 15
  br i1 %13, label %.lr.ph, label %._crit_edge

.lr.ph:                                           ; preds = %3
  %14 = insertelement <16 x i64> poison, i64 %8, i64 0
  %15 = shufflevector <16 x i64> %14, <16 x i64> poison, <16 x i32> zeroinitializer
  br label %16

16:                                               ; preds = %.lr.ph, %16
  %17 = phi i64 [ %1, %.lr.ph ], [ %27, %16 ]
  %18 = trunc nuw nsw i64 %17 to i32
  %19 = insertelement <16 x i32> poison, i32 %18, i64 0
  %20 = shufflevector <16 x i32> %19, <16 x i32> poison, <16 x i32> zeroinitializer
  %21 = add <16 x i32> %20, <i32 0, i32 1, i32 2, i32 3, i32 4, i32 5, i32 6, i32 7, i32 8, i32 9, i32 10, i32 11, i32 12, i32 13, i32 14, i32 15>
  %22 = sext <16 x i32> %21 to <16 x i64>
  %23 = mul <16 x i64> %15, %22
  %24 = getelementptr i8, ptr %5, <16 x i64> %23
  %25 = tail call <16 x float> @llvm.masked.gather.v16f32.v16p0(<16 x ptr> align 4 %24, <16 x i1> splat (i1 true), <16 x float> poison)
  %26 = fmul <16 x float> %25, %25
  tail call void @llvm.masked.scatter.v16f32.v16p0(<16 x float> %26, <16 x ptr> align 4 %24, <16 x i1> splat (i1 true))
  %27 = add i64 %17, 16
  %28 = icmp slt i64 %27, %12
  br i1 %28, label %16, label %._crit_edge

._crit_edge:                                      ; preds = %16, %3
  %29 = icmp slt i64 %12, %9
  br i1 %29, label %30, label %47

30:                                               ; preds = %._crit_edge
  %31 = sub nuw nsw i64 %9, %12
  %32 = trunc nuw nsw i64 %31 to i32
  %33 = insertelement <16 x i32> poison, i32 %32, i64 0
  %34 = shufflevector <16 x i32> %33, <16 x i32> poison, <16 x i32> zeroinitializer
  %35 = icmp sgt <16 x i32> %34, <i32 0, i32 1, i32 2, i32 3, i32 4, i32 5, i32 6, i32 7, i32 8, i32 9, i32 10, i32 11, i32 12, i32 13, i32 14, i32 15>
  %36 = trunc nuw nsw i64 %12 to i32
  %37 = insertelement <16 x i32> poison, i32 %36, i64 0
  %38 = shufflevector <16 x i32> %37, <16 x i32> poison, <16 x i32> zeroinitializer
  %39 = add <16 x i32> %38, <i32 0, i32 1, i32 2, i32 3, i32 4, i32 5, i32 6, i32 7, i32 8, i32 9, i32 10, i32 11, i32 12, i32 13, i32 14, i32 15>
  %40 = sext <16 x i32> %39 to <16 x i64>
  %41 = insertelement <16 x i64> poison, i64 %8, i64 0
  %42 = shufflevector <16 x i64> %41, <16 x i64> poison, <16 x i32> zeroinitializer
  %43 = mul <16 x i64> %42, %40
  %44 = getelementptr i8, ptr %5, <16 x i64> %43
  %45 = tail call <16 x float> @llvm.masked.gather.v16f32.v16p0(<16 x ptr> align 4 %44, <16 x i1> %35, <16 x float> zeroinitializer)
  %46 = fmul <16 x float> %45, %45
  tail call void @llvm.masked.scatter.v16f32.v16p0(<16 x float> %46, <16 x ptr> align 4 %44, <16 x i1> %35)
  br label %47

47:                                               ; preds = %._crit_edge, %30
  ret void
}

; Function Attrs: mustprogress nocallback nocreateundeforpoison nofree nosync nounwind speculatable willreturn memory(none)
declare i64 @llvm.smax.i64(i64, i64) #1

; Function Attrs: mustprogress nocallback nofree nosync nounwind willreturn memory(read)
declare <16 x float> @llvm.masked.gather.v16f32.v16p0(<16 x ptr>, <16 x i1>, <16 x float>) #2

; Function Attrs: mustprogress nocallback nofree nosync nounwind willreturn memory(write)
declare void @llvm.masked.scatter.v16f32.v16p0(<16 x float>, <16 x ptr>, <16 x i1>) #3

attributes #0 = { nofree norecurse nosync nounwind }
attributes #1 = { mustprogress nocallback nocreateundeforpoison nofree nosync nounwind speculatable willreturn memory(none) }
attributes #2 = { mustprogress nocallback nofree nosync nounwind willreturn memory(read) }
attributes #3 = { mustprogress nocallback nofree nosync nounwind willreturn memory(write) }

!llvm.module.flags = !{!0}

!0 = !{i32 2, !"Debug Info Version", i32 3}
!1 = !{}
