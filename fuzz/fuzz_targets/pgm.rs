//! PGM pictures, binary and plain.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| mapweld_fuzz::picture(bytes));
