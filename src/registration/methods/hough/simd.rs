//! Kernels over lanes: one source, built twice, for every processor and for those with AVX2.
//!
//! A kernel is plain code over arrays of [`LANES`] numbers, which the compiler turns into vector instructions of whatever
//! width it may assume. [`widest!`](widest) builds it a second time with AVX2 and picks at run time. Both builds do the
//! same operations in the same order, none of them fused, so their results are equal to the bit: an answer does not depend
//! on the processor's kernels.

/// Samples that a kernel works on together: what one AVX register holds in single precision.
pub(super) const LANES: usize = 8;

/// Defines a function twice, the second time with AVX2, and calls the one that the processor has.
macro_rules! widest {
    ($(#[$attribute:meta])* $visibility:vis fn $name:ident$(<const $constant:ident: $kind:ty>)?(
        $($argument:ident: $type:ty),* $(,)?
    ) $(-> $result:ty)? $body:block) => {
        $(#[$attribute])*
        $visibility fn $name$(<const $constant: $kind>)?($($argument: $type),*) $(-> $result)? {
            #[inline(always)]
            fn kernel_portable$(<const $constant: $kind>)?($($argument: $type),*) $(-> $result)? $body

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            fn kernel_avx2$(<const $constant: $kind>)?($($argument: $type),*) $(-> $result)? {
                kernel_portable$(::<$constant>)?($($argument),*)
            }

            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                #[expect(unsafe_code, reason = "calls a safe function that needs AVX2, which was detected just above")]
                // SAFETY: `kernel_avx2` is safe code; all that it asks for is AVX2, and the processor has it.
                return unsafe { kernel_avx2$(::<$constant>)?($($argument),*) };
            }
            kernel_portable$(::<$constant>)?($($argument),*)
        }
    };
}

pub(super) use widest;
