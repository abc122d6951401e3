//! Where a request or a job stands in a trace (W3C Trace Context, level 2).

use std::fmt;
use std::num::{NonZeroU64, NonZeroU128};
use std::str::FromStr;

use super::Invalid;

/// A span of a trace, as others are told of it: the value of `traceparent`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TraceParent {
    trace: NonZeroU128,
    span: NonZeroU64,
    sampled: bool,
}

impl TraceParent {
    /// A span of a trace; `None` when an id is 0, which stands for none. `sampled`: whether somebody records it.
    #[must_use]
    pub fn new(trace: u128, span: u64, sampled: bool) -> Option<Self> {
        Some(Self {
            trace: NonZeroU128::new(trace)?,
            span: NonZeroU64::new(span)?,
            sampled,
        })
    }

    /// The id of the trace.
    #[must_use]
    pub fn trace(self) -> u128 {
        self.trace.get()
    }

    /// The id of the trace, as logs tell it: 32 hexadecimal digits.
    #[must_use]
    pub fn trace_id(self) -> String {
        format!("{:032x}", self.trace)
    }

    /// The id of the span.
    #[must_use]
    pub fn span(self) -> u64 {
        self.span.get()
    }

    /// Whether somebody records it.
    #[must_use]
    pub fn is_sampled(self) -> bool {
        self.sampled
    }

    /// Another span of the same trace; `None` when its id is 0.
    #[must_use]
    pub fn with_span(self, span: u64) -> Option<Self> {
        Self::new(self.trace(), span, self.sampled)
    }
}

impl fmt::Display for TraceParent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flags = u8::from(self.sampled);
        write!(f, "00-{:032x}-{:016x}-{flags:02x}", self.trace, self.span)
    }
}

impl FromStr for TraceParent {
    type Err = Invalid;

    /// Versions after 00 are read as far as 00 goes, as the standard wants it.
    fn from_str(text: &str) -> Result<Self, Invalid> {
        let bad = || Invalid::new("traceparent", text, "00-TRACE-SPAN-FLAGS in small hexadecimal digits");
        let hex = |text: &str| text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
        let mut parts = text.splitn(5, '-');
        let mut next = |digits: usize| {
            let part = parts.next().filter(|part| part.len() == digits && hex(part));
            part.ok_or_else(bad)
        };
        let (version, trace, span, flags) = (next(2)?, next(32)?, next(16)?, next(2)?);
        if version == "ff" || (version == "00" && parts.next().is_some()) {
            return Err(bad());
        }
        let trace = u128::from_str_radix(trace, 16).map_err(|_| bad())?;
        let span = u64::from_str_radix(span, 16).map_err(|_| bad())?;
        let flags = u8::from_str_radix(flags, 16).map_err(|_| bad())?;
        Self::new(trace, span, flags & 1 == 1).ok_or_else(bad)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example of the standard.
    const EXAMPLE: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

    #[test]
    fn a_traceparent_is_read_as_it_is_written() {
        let read: TraceParent = EXAMPLE.parse().expect("the example");
        assert_eq!(read.to_string(), EXAMPLE);
        assert_eq!(read.trace_id(), "0af7651916cd43dd8448eb211c80319c");
        assert_eq!((read.span(), read.is_sampled()), (0xb7ad_6b71_6920_3331, true));
        let later = format!("01{}-what-a-later-version-says", &EXAMPLE[2..]);
        assert_eq!(later.parse(), Ok(read));
    }

    #[test]
    fn what_the_standard_calls_invalid_is_refused() {
        let zeros = |from: usize, to: usize| {
            let mut text = EXAMPLE.to_owned();
            text.replace_range(from..to, &"0".repeat(to - from));
            text
        };
        for bad in [
            "",
            &EXAMPLE[..54],
            &format!("{EXAMPLE}-x"),
            &format!("ff{}", &EXAMPLE[2..]),
            &EXAMPLE.to_uppercase(),
            &zeros(3, 35),
            &zeros(36, 52),
        ] {
            assert!(bad.parse::<TraceParent>().is_err(), "{bad}");
        }
    }
}
