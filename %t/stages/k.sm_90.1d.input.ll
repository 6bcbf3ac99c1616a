; ModuleID = 'k'
source_filename = "k"
target datalayout = "e-p6:32:32-i64:64-i128:128-i256:256-v16:16-v32:32-n16:32:64"
target triple = "nvptx64-nvidia-cuda"

; Function Attrs: nounwind
define ptx_kernel void @k(ptr byval([80 x i8]) align 8 "nvvm.grid_constant" %0) #0 {
  %2 = load i32, ptr %0, align 4, !invariant.load !3
  %3 = getelementptr inbounds i8, ptr %0, i32 24
  %4 = load ptr addrspace(1), ptr %3, align 8, !invariant.load !3
  %5 = getelementptr inbounds i8, ptr %0, i32 40
  %6 = load i32, ptr %5, align 4, !invariant.load !3
  %7 = getelementptr inbounds i8, ptr %0, i32 56
  %8 = load i32, ptr %7, align 4, !invariant.load !3
  %9 = sext i32 %8 to i64
  br label %10

10:                                               ; preds = %1
  %11 = call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %12 = sext i32 %11 to i64
  %13 = call i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
  %14 = sext i32 %13 to i64
  %15 = mul nuw nsw i32 %11, %13
  %16 = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %17 = sext i32 %16 to i64
  %18 = add nuw nsw i32 %15, %16
  %19 = icmp slt i32 %18, %2
  br i1 %19, label %20, label %37

20:                                               ; preds = %10
  %21 = sext i32 %11 to i64
  %22 = sext i32 %13 to i64
  %23 = mul nsw i64 %21, %22
  %24 = sext i32 %16 to i64
  %25 = add nsw i64 %23, %24
  %26 = mul nsw i64 %25, %9
  %27 = getelementptr inbounds i8, ptr addrspace(1) %4, i64 %26
  %28 = load float, ptr addrspace(1) %27, align 4
  %29 = fmul float %28, %28
  %30 = sext i32 %11 to i64
  %31 = sext i32 %13 to i64
  %32 = mul nsw i64 %30, %31
  %33 = sext i32 %16 to i64
  %34 = add nsw i64 %32, %33
  %35 = mul nsw i64 %34, %9
  %36 = getelementptr inbounds i8, ptr addrspace(1) %4, i64 %35
  store float %29, ptr addrspace(1) %36, align 4
  br label %37

37:                                               ; preds = %20, %10
  br label %38

38:                                               ; preds = %37
  ret void
}

; Function Attrs: nocallback nofree nosync nounwind speculatable willreturn memory(none)
declare noundef range(i32 0, 2147483647) i32 @llvm.nvvm.read.ptx.sreg.ctaid.x() #1

; Function Attrs: nocallback nofree nosync nounwind speculatable willreturn memory(none)
declare noundef range(i32 1, 1025) i32 @llvm.nvvm.read.ptx.sreg.ntid.x() #1

; Function Attrs: nocallback nofree nosync nounwind speculatable willreturn memory(none)
declare noundef range(i32 0, 1024) i32 @llvm.nvvm.read.ptx.sreg.tid.x() #1

attributes #0 = { nounwind "nvvm.maxntid"="256" }
attributes #1 = { nocallback nofree nosync nounwind speculatable willreturn memory(none) }

!llvm.module.flags = !{!0, !1, !2}

!0 = !{i32 2, !"Debug Info Version", i32 3}
!1 = !{i32 4, !"nvvm-reflect-ftz", i32 0}
!2 = !{i32 4, !"nvvm-reflect-prec-sqrt", i32 1}
!3 = !{}
