; ModuleID = 'k'
source_filename = "k"
target datalayout = "e-p6:32:32-i64:64-i128:128-i256:256-v16:16-v32:32-n16:32:64"
target triple = "nvptx64-nvidia-cuda"

; Function Attrs: mustprogress nofree norecurse nosync nounwind willreturn memory(readwrite, inaccessiblemem: none, target_mem0: none, target_mem1: none)
define ptx_kernel void @k(ptr readonly byval([80 x i8]) align 8 captures(none) "nvvm.grid_constant" %0) local_unnamed_addr #0 {
  %2 = load i32, ptr %0, align 8, !invariant.load !3
  %3 = tail call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %4 = tail call range(i32 1, 257) i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
  %5 = mul nuw nsw i32 %3, %4
  %6 = tail call range(i32 0, 256) i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %7 = add nuw nsw i32 %5, %6
  %8 = icmp slt i32 %7, %2
  br i1 %8, label %9, label %24

9:                                                ; preds = %1
  %10 = getelementptr inbounds nuw i8, ptr %0, i64 56
  %11 = load i32, ptr %10, align 8, !invariant.load !3
  %12 = sext i32 %11 to i64
  %13 = getelementptr inbounds nuw i8, ptr %0, i64 24
  %14 = load ptr addrspace(1), ptr %13, align 8, !invariant.load !3
  %15 = zext nneg i32 %3 to i64
  %16 = zext nneg i32 %4 to i64
  %17 = mul nuw nsw i64 %15, %16
  %18 = zext nneg i32 %6 to i64
  %19 = add nuw nsw i64 %17, %18
  %20 = mul nsw i64 %19, %12
  %21 = getelementptr inbounds i8, ptr addrspace(1) %14, i64 %20
  %22 = load float, ptr addrspace(1) %21, align 4
  %23 = fmul float %22, %22
  store float %23, ptr addrspace(1) %21, align 4
  br label %24

24:                                               ; preds = %1, %9
  ret void
}

; Function Attrs: mustprogress nocallback nofree nosync nounwind speculatable willreturn memory(none)
declare noundef range(i32 0, 2147483647) i32 @llvm.nvvm.read.ptx.sreg.ctaid.x() #1

; Function Attrs: mustprogress nocallback nofree nosync nounwind speculatable willreturn memory(none)
declare noundef range(i32 1, 1025) i32 @llvm.nvvm.read.ptx.sreg.ntid.x() #1

; Function Attrs: mustprogress nocallback nofree nosync nounwind speculatable willreturn memory(none)
declare noundef range(i32 0, 1024) i32 @llvm.nvvm.read.ptx.sreg.tid.x() #1

attributes #0 = { mustprogress nofree norecurse nosync nounwind willreturn memory(readwrite, inaccessiblemem: none, target_mem0: none, target_mem1: none) "nvvm.maxntid"="256" }
attributes #1 = { mustprogress nocallback nofree nosync nounwind speculatable willreturn memory(none) }

!llvm.module.flags = !{!0, !1, !2}

!0 = !{i32 2, !"Debug Info Version", i32 3}
!1 = !{i32 4, !"nvvm-reflect-ftz", i32 0}
!2 = !{i32 4, !"nvvm-reflect-prec-sqrt", i32 1}
!3 = !{}
