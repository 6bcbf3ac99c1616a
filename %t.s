	.file	"k"
	.section	.rodata,"a",@progbits
	.p2align	6, 0x0
.LCPI0_0:
	.long	0
	.long	1
	.long	2
	.long	3
	.long	4
	.long	5
	.long	6
	.long	7
	.long	8
	.long	9
	.long	10
	.long	11
	.long	12
	.long	13
	.long	14
	.long	15
	.text
	.globl	k
	.p2align	4
	.type	k,@function
k:
	movq	24(%rdi), %rax
	movslq	56(%rdi), %rdi
	cmpq	%rdx, %rsi
	cmovgq	%rsi, %rdx
	movq	%rdx, %r8
	subq	%rsi, %r8
	movq	%r8, %rcx
	andq	$-16, %rcx
	addq	%rsi, %rcx
	vpbroadcastq	%rdi, %zmm0
	cmpq	$16, %r8
	jl	.LBB0_3
	vmovdqa64	.LCPI0_0(%rip), %zmm1
	.p2align	4
.LBB0_2:
	vpbroadcastd	%esi, %zmm2
	vpaddd	%zmm1, %zmm2, %zmm2
	vextracti64x4	$1, %zmm2, %ymm3
	vpmovzxdq	%ymm3, %zmm3
	vpmovzxdq	%ymm2, %zmm2
	vpmuldq	%zmm2, %zmm0, %zmm2
	vpmuldq	%zmm3, %zmm0, %zmm3
	kxnorb	%k0, %k0, %k1
	kxnorb	%k0, %k0, %k2
	vxorps	%xmm4, %xmm4, %xmm4
	vgatherqps	(%rax,%zmm2), %ymm4 {%k2}
	vxorps	%xmm5, %xmm5, %xmm5
	vgatherqps	(%rax,%zmm3), %ymm5 {%k1}
	vmulps	%ymm4, %ymm4, %ymm4
	kxnorb	%k0, %k0, %k1
	vscatterqps	%ymm4, (%rax,%zmm2) {%k1}
	vmulps	%ymm5, %ymm5, %ymm2
	kxnorb	%k0, %k0, %k1
	vscatterqps	%ymm2, (%rax,%zmm3) {%k1}
	addq	$16, %rsi
	cmpq	%rcx, %rsi
	jl	.LBB0_2
.LBB0_3:
	cmpq	%rcx, %rdx
	jle	.LBB0_5
	subl	%ecx, %edx
	vpbroadcastd	%edx, %zmm1
	vmovdqa64	.LCPI0_0(%rip), %zmm2
	vpcmpgtd	%zmm2, %zmm1, %k1
	vpbroadcastd	%ecx, %zmm1
	vpaddd	%zmm2, %zmm1, %zmm1
	vextracti64x4	$1, %zmm1, %ymm2
	vpmovzxdq	%ymm2, %zmm2
	vpmovzxdq	%ymm1, %zmm1
	vpmuldq	%zmm1, %zmm0, %zmm1
	vpmuldq	%zmm2, %zmm0, %zmm0
	kshiftrw	$8, %k1, %k2
	kmovq	%k2, %k3
	vpxor	%xmm2, %xmm2, %xmm2
	vgatherqps	(%rax,%zmm0), %ymm2 {%k3}
	vxorps	%xmm3, %xmm3, %xmm3
	kmovq	%k1, %k3
	vgatherqps	(%rax,%zmm1), %ymm3 {%k3}
	vmulps	%ymm3, %ymm3, %ymm3
	vscatterqps	%ymm3, (%rax,%zmm1) {%k1}
	vmulps	%ymm2, %ymm2, %ymm1
	vscatterqps	%ymm1, (%rax,%zmm0) {%k2}
.LBB0_5:
	vzeroupper
	retq
.Lfunc_end0:
	.size	k, .Lfunc_end0-k

	.section	".note.GNU-stack","",@progbits
