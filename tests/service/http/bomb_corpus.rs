//! Requests that are small, or no larger than is allowed, and grow without end in a server that trusts them.

use std::io::Write as _;

use flate2::write::{GzEncoder, ZlibEncoder};
use flate2::{Compression, Crc};

use super::rooms::{Files, scrap};

/// A request that must be refused.
pub(super) struct Bomb {
    /// What it is.
    pub(super) name: &'static str,
    pub(super) method: &'static str,
    pub(super) path: String,
    /// Name and value of each.
    pub(super) headers: Vec<(&'static str, &'static str)>,
    pub(super) body: Vec<u8>,
}

const MAPS: &str = "/v1/sessions/hall/robots/r1/maps";
const PLACED: &str = "/v1/sessions/hall/robots/r1/maps?resolution=0.05&origin=0,0,0";
const FORM: &str = "multipart/form-data; boundary=x";

impl Bomb {
    fn new(name: &'static str, path: &str, content_type: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self {
            name,
            method: "POST",
            path: path.to_owned(),
            headers: vec![("content-type", content_type)],
            body: body.into(),
        }
    }

    fn put(mut self) -> Self {
        self.method = "PUT";
        self
    }

    fn gzip(mut self) -> Self {
        self.headers.push(("content-encoding", "gzip"));
        self
    }
}

/// All bombs, each made when its turn comes.
pub(super) fn all() -> Vec<fn() -> Bomb> {
    let mut all: Vec<fn() -> Bomb> = Vec::new();
    all.extend(PICTURES);
    all.extend(YAML);
    all.extend(ENCODED);
    all.extend(PARTS);
    all.extend(JSON);
    all
}

/// Pictures of more cells than are allowed, and pictures with more in them than a picture.
const PICTURES: &[fn() -> Bomb] = &[
    || Bomb::new("PNG of 30,000 x 30,000", PLACED, "image/png", vast_png(0)),
    || Bomb::new("interlaced PNG of 30,000 x 30,000", PLACED, "image/png", vast_png(1)),
    || form("PNG of 30,000 x 30,000 in a form", MAPS, &yaml("m.png"), &vast_png(0)),
    || {
        Bomb::new("PNG header of 2^31 - 1 squared", PLACED, "image/png", {
            png(0x7fff_ffff, 0x7fff_ffff, 0, &[])
        })
    },
    || {
        Bomb::new("PNG with a profile of 1 GB", PLACED, "image/png", {
            png(
                4,
                4,
                0,
                &[chunk(*b"iCCP", &[b"x\0\0", &zeros_in_zlib(1 << 30)[..]].concat())],
            )
        })
    },
    || {
        Bomb::new("PNG with a text of 1 GB", PLACED, "image/png", {
            png(
                4,
                4,
                0,
                &[chunk(*b"zTXt", &[b"x\0\0", &zeros_in_zlib(1 << 30)[..]].concat())],
            )
        })
    },
    || {
        Bomb::new("PNG with an international text of 1 GB", PLACED, "image/png", {
            let text = [b"x\0\x01\0\0\0", &zeros_in_zlib(1 << 30)[..]].concat();
            png(4, 4, 0, &[chunk(*b"iTXt", &text)])
        })
    },
    || {
        Bomb::new("PNG whose 16 pixels unpack to 1 GB", PLACED, "image/png", {
            // the filter of the first row is none of the five
            let mut pixels = ZlibEncoder::new(Vec::new(), Compression::fast());
            pixels.write_all(&[9]).expect("a vector takes it");
            png(
                4,
                4,
                0,
                &[chunk(*b"IDAT", &zeros_into(pixels, 1 << 30, ZlibEncoder::finish))],
            )
        })
    },
    || {
        Bomb::new("PNG chunk of 2^31 - 1 bytes", PLACED, "image/png", {
            [&png(4, 4, 0, &[])[..33], &[0x7f, 0xff, 0xff, 0xff], b"IDAT", &[0; 64]].concat()
        })
    },
    || Bomb::new("PGM header of 2^31 x 1", PLACED, PGM, "P5 2147483648 1 255\n\0"),
    || Bomb::new("PGM header of 2^16 x 2^15", PLACED, PGM, "P5 65536 32768 255\n\0"),
    || Bomb::new("PGM header within the limit", PLACED, PGM, "P5 8192 8192 65535\n\0"),
    || {
        Bomb::new(
            "plain PGM header within the limit",
            PLACED,
            PGM,
            "P2 8192 8192 65535\n0 ",
        )
    },
    || Bomb::new("PGM header of 2^64", PLACED, PGM, "P5 18446744073709551616 1 255\n\0"),
    || Bomb::new("PGM maximum of 2^31", PLACED, PGM, "P5 2 2 2147483648\n\0\0\0\0"),
    || {
        Bomb::new(
            "PGM header of 32 MB",
            PLACED,
            PGM,
            [&b"P5 "[..], &b"9".repeat(32 << 20)].concat(),
        )
    },
    || {
        Bomb::new(
            "PGM comment of 32 MB",
            PLACED,
            PGM,
            [&b"P5 #"[..], &b"#".repeat(32 << 20)].concat(),
        )
    },
];

const PGM: &str = "image/x-portable-graymap";

/// Map files that mean more than they say.
const YAML: &[fn() -> Bomb] = &[
    || form("YAML anchors, 10^9 laughs", MAPS, &laughs(9, 10), b"P5 1 1 255\n\0"),
    || form("YAML anchors, 2^24 laughs", MAPS, &laughs(24, 2), b"P5 1 1 255\n\0"),
    || {
        form(
            "YAML anchors in an origin",
            MAPS,
            "image: m.pgm\nresolution: 0.05\na: &a [0, 0]\norigin: [*a, *a, *a]\n",
            b"P5 1 1 255\n\0",
        )
    },
    || {
        form(
            "YAML within itself",
            MAPS,
            "image: m.pgm\nresolution: 1\norigin: &a [*a, *a, *a]\n",
            b"P5 1 1 255\n\0",
        )
    },
    || {
        form(
            "YAML 30,000 deep",
            MAPS,
            &format!("origin: {}", "[".repeat(30_000)),
            b"P5 1 1 255\n\0",
        )
    },
    || form("YAML of 32 MB", MAPS, &"a: b\n".repeat(6 << 20), b"P5 1 1 255\n\0"),
    || {
        form(
            "YAML number of 60,000 digits",
            MAPS,
            &format!("image: m.pgm\nresolution: {}\norigin: [0, 0, 0]\n", "9".repeat(60_000)),
            b"P5 1 1 255\n\0",
        )
    },
    || {
        form(
            "YAML origin of 30,000 numbers",
            MAPS,
            &format!("image: m.pgm\nresolution: 1\norigin: [{}0]\n", "0,".repeat(30_000)),
            b"P5 1 1 255\n\0",
        )
    },
];

/// Bodies that say that they are compressed.
const ENCODED: &[fn() -> Bomb] = &[
    || Bomb::new("gzip of 1 GB as a picture", PLACED, "image/png", zeros_in_gzip(1 << 30)).gzip(),
    || {
        Bomb::new(
            "gzip of 1 GB as a message",
            MAPS,
            "application/json",
            zeros_in_gzip(1 << 30),
        )
        .gzip()
    },
    || Bomb::new("gzip of 1 GB as a form", "/v1/merge", FORM, zeros_in_gzip(1 << 30)).gzip(),
    || {
        Bomb::new(
            "gzip of 1 GB as settings",
            "/v1/sessions/hall",
            "application/json",
            zeros_in_gzip(1 << 30),
        )
        .gzip()
        .put()
    },
    || {
        Bomb::new(
            "gzip of 1 GB that does not say so",
            PLACED,
            "image/png",
            zeros_in_gzip(1 << 30),
        )
    },
];

/// Forms of too much.
const PARTS: &[fn() -> Bomb] = &[
    || Bomb::new("10^6 parts for a map", MAPS, FORM, parts("map", 1_000_000)),
    || Bomb::new("10^6 parts for a merge", "/v1/merge", FORM, parts("map", 1_000_000)),
    || {
        Bomb::new(
            "10^6 pictures for a merge",
            "/v1/merge",
            FORM,
            parts("image", 1_000_000),
        )
    },
    || {
        Bomb::new("a part whose head is 32 MB", MAPS, FORM, {
            let name = "n".repeat(32 << 20);
            format!("--x\r\nContent-Disposition: form-data; name=\"{name}\"\r\n\r\n\r\n--x--\r\n")
        })
    },
    || {
        Bomb::new("a part with 10^6 headers", MAPS, FORM, {
            let headers = "a: b\r\n".repeat(1_000_000);
            format!("--x\r\nContent-Disposition: form-data; name=\"map\"\r\n{headers}\r\n\r\n--x--\r\n")
        })
    },
    || {
        form(
            "a picture of 60 MB that is none",
            MAPS,
            &yaml("m.png"),
            &vec![b'x'; 60 << 20],
        )
    },
    || {
        form(
            "a picture of 120 MB that is none",
            MAPS,
            &yaml("m.png"),
            &vec![b'x'; 120 << 20],
        )
    },
    || {
        Bomb::new(
            "a form of 60 MB before its first part",
            MAPS,
            FORM,
            vec![b'-'; 60 << 20],
        )
    },
];

/// JSON that is deep, long or beyond all numbers.
const JSON: &[fn() -> Bomb] = &[
    || json("JSON 10^6 deep", "[".repeat(1_000_000)),
    || {
        json(
            "JSON 10^6 deep in a member that nobody reads",
            format!("{{\"x\": {}", "{\"x\":".repeat(1_000_000)),
        )
    },
    || {
        Bomb::new("settings 500,000 deep", "/v1/sessions/hall", "application/json", {
            format!("{{\"parameters\": {}", "[".repeat(500_000))
        })
        .put()
    },
    || {
        Bomb::new("settings of 2 MB", "/v1/sessions/hall", "application/json", {
            format!("{{\"title\": \"{}\"}}", "x".repeat(2 << 20))
        })
        .put()
    },
    || {
        Bomb::new(
            "settings with 80,000 labels",
            "/v1/sessions/hall",
            "application/json",
            {
                let labels: Vec<String> = (0..80_000).map(|label| format!("\"l{label}\": \"\"")).collect();
                format!("{{\"labels\": {{{}}}}}", labels.join(","))
            },
        )
        .put()
    },
    || message("1e999", "1", "1", "[0]"),
    || message("0.05", "4294967296", "1", "[0]"),
    || message("0.05", "1e30", "1", "[0]"),
    || message("0.05", "4294967295", "4294967295", "[0]"),
    || message("0.05", "65536", "32768", "\"\""),
    || message("0.05", "8192", "8192", "[0]"),
    || message("0.05", "1", "1", "[1e400]"),
    || message("0.05", "1", "1", &format!("[{}]", "9".repeat(1_000_000))),
    || message("0.05", "1", "1", &format!("[0.{}]", "9".repeat(1_000_000))),
    || message("0.05", "1", "1", &format!("[{}0]", "0,".repeat(30 << 20))),
    || message("0.05", "1", "1", &format!("\"{}\"", "A".repeat(60 << 20))),
    || message("0.05", "1", "1", &format!("\"{}\"", "\\u0041".repeat(10 << 20))),
    || {
        json(
            "a text of 32 MB for a number",
            format!("{{\"info\": \"{}\"}}", "x".repeat(32 << 20)),
        )
    },
    || {
        json(
            "a text of 120 MB for a number",
            format!("{{\"info\": \"{}\"}}", "x".repeat(120 << 20)),
        )
    },
    || {
        json(
            "a text of 120 MB for a message",
            format!("\"{}\"", "x".repeat(120 << 20)),
        )
    },
    || json("a name of 120 MB", format!("{{\"{}\": 1}}", "x".repeat(120 << 20))),
    || message("0.05", "1", "1", &format!("\"\\/{}\"", "A".repeat(120 << 20))),
    || {
        json(
            "a name of 32 MB",
            format!("{{\"info\": {{\"resolution\": 1, \"{}\": 1}}}}", "x".repeat(32 << 20)),
        )
    },
];

fn json(name: &'static str, body: String) -> Bomb {
    Bomb::new(name, MAPS, "application/json", body)
}

fn message(resolution: &str, width: &str, height: &str, data: &str) -> Bomb {
    json("an OccupancyGrid of such size, numbers or data", {
        format!(
            "{{\"info\": {{\"resolution\": {resolution}, \"width\": {width}, \"height\": {height}, \"origin\": \
             {{\"position\": {{\"x\": 1e308, \"y\": -1e308}}}}}}, \"data\": {data}}}"
        )
    })
}

fn yaml(image: &str) -> String {
    let files = Files::of("m", &scrap(1));
    String::from_utf8(files.yaml)
        .expect("YAML is text")
        .replace("m.pgm", image)
}

/// `depth` levels of lists, each of `width` times the one below.
fn laughs(depth: usize, width: usize) -> String {
    let mut text = "a0: &a0 [x]\n".to_owned();
    for level in 1..=depth {
        let below = format!("*a{}", level - 1);
        text = format!("{text}a{level}: &a{level} [{}]\n", vec![below; width].join(", "));
    }
    format!("{text}image: *a{depth}\nresolution: 0.05\norigin: *a{depth}\n")
}

fn form(name: &'static str, path: &str, yaml: &str, image: &[u8]) -> Bomb {
    let head = |part: &str| format!("--x\r\nContent-Disposition: form-data; name=\"{part}\"; filename=\"m\"\r\n\r\n");
    let (map, picture) = (head("map"), format!("\r\n{}", head("image")));
    let body = [
        map.as_bytes(),
        yaml.as_bytes(),
        picture.as_bytes(),
        image,
        b"\r\n--x--\r\n",
    ]
    .concat();
    Bomb::new(name, path, FORM, body)
}

fn parts(name: &str, count: usize) -> Vec<u8> {
    let part = format!("--x\r\nContent-Disposition: form-data; name=\"{name}\"\r\n\r\n\r\n");
    [part.repeat(count).as_bytes(), b"--x--\r\n"].concat()
}

/// A whole picture of 900 million pixels in less than a megabyte.
fn vast_png(interlace: u8) -> Vec<u8> {
    const SIDE: u32 = 30_000;
    let bytes = u64::from(SIDE) * u64::from(SIDE + 1);
    png(SIDE, SIDE, interlace, &[chunk(*b"IDAT", &zeros_in_zlib(bytes))])
}

/// An 8-bit grey PNG with these chunks.
fn png(width: u32, height: u32, interlace: u8, chunks: &[Vec<u8>]) -> Vec<u8> {
    let header = [
        &width.to_be_bytes()[..],
        &height.to_be_bytes(),
        &[8, 0, 0, 0, interlace],
    ]
    .concat();
    let mut picture = b"\x89PNG\r\n\x1a\n".to_vec();
    picture.extend(chunk(*b"IHDR", &header));
    picture.extend(chunks.concat());
    picture.extend(chunk(*b"IEND", &[]));
    picture
}

fn chunk(kind: [u8; 4], bytes: &[u8]) -> Vec<u8> {
    let length = u32::try_from(bytes.len()).expect("a chunk of less than 4 GB");
    let mut sum = Crc::new();
    sum.update(&kind);
    sum.update(bytes);
    [&length.to_be_bytes()[..], &kind, bytes, &sum.sum().to_be_bytes()].concat()
}

fn zeros_in_zlib(count: u64) -> Vec<u8> {
    zeros_into(
        ZlibEncoder::new(Vec::new(), Compression::fast()),
        count,
        ZlibEncoder::finish,
    )
}

fn zeros_in_gzip(count: u64) -> Vec<u8> {
    zeros_into(
        GzEncoder::new(Vec::new(), Compression::fast()),
        count,
        GzEncoder::finish,
    )
}

fn zeros_into<W: std::io::Write>(
    mut encoder: W,
    count: u64,
    finish: impl FnOnce(W) -> std::io::Result<Vec<u8>>,
) -> Vec<u8> {
    let block = vec![0; 1 << 20];
    let mut left = count;
    while left > 0 {
        let now = left.min(block.len() as u64);
        let taken = &block[..usize::try_from(now).expect("a megabyte at most")];
        encoder.write_all(taken).expect("a vector takes it");
        left -= now;
    }
    finish(encoder).expect("a vector takes it")
}
