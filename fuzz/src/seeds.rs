//! Inputs to begin with: maps as mapweld writes them, and the forms that they come in.

use mapweld::codec::{encode_cells, encode_occupancy_grid, encode_pgm, encode_png, encode_yaml};
use mapweld::geometry::{Angle, Pose2};
use mapweld::grid::{Lattice, LogOdds, OccupancyGrid};

/// Inputs: target, name, bytes.
#[must_use]
pub fn seeds() -> Vec<(&'static str, String, Vec<u8>)> {
    let mut seeds = Vec::new();
    let mut add = |target, name: &str, bytes: &[u8]| seeds.push((target, name.to_owned(), bytes.to_vec()));
    add("yaml", "anchors.yaml", ANCHORS);
    add("pgm", "plain.pgm", b"\x01P2 # plain\n3 2\n7\n0 1 2 3 4 7\n");
    add("pgm", "wide.pgm", b"\x02P5 2 1 65535\n\0\x01\x02\x03");
    add("occupancy_grid", "base64.json", BASE64);
    for side in [1, 5, 40] {
        let grid = map(side);
        let yaml = encode_yaml(grid.lattice(), "m.png");
        let (png, pgm) = (encode_png(&grid), encode_pgm(&grid));
        let message = encode_occupancy_grid(&grid, "map");
        add("yaml", &format!("{side}.yaml"), yaml.as_bytes());
        for (pick, picture) in [(0, &png), (1, &encode_cells(&grid)), (0x82, &png)] {
            add("png", &format!("{side}-{pick}.png"), &[&[pick], &picture[..]].concat());
        }
        add("pgm", &format!("{side}.pgm"), &[b"\0", &pgm[..]].concat());
        add("occupancy_grid", &format!("{side}.json"), &message);
        let head = b"image/png?resolution=0.05&origin=1,2,0.5\n";
        add("multipart", &format!("{side}-png"), &[&head[..], &png].concat());
        let head = b"application/json\n";
        add("multipart", &format!("{side}-json"), &[&head[..], &message].concat());
        add("multipart", &format!("{side}-form"), &form(&yaml, &pgm));
    }
    seeds
}

const ANCHORS: &[u8] = b"a: &a 0\nimage: m.png\nresolution: 0.05\norigin: [*a, *a, *a]\nnegate: yes\n";

const BASE64: &[u8] =
    br#"{"info": {"resolution": 0.1, "width": 3, "height": 1, "origin": {"position": {"x": 0, "y": 0},
    "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}}, "data": "AGT/"}"#;

/// A square map with a wall, of which nobody has seen the rest.
fn map(side: u32) -> OccupancyGrid {
    let origin = Pose2::new(-1.0, 2.5, Angle::from_degrees(30.0));
    let mut grid = OccupancyGrid::unknown(Lattice::new(side, side, 0.05, origin).expect("a small lattice"));
    for (index, cell) in grid.cells_mut().iter_mut().enumerate() {
        match index % 7 {
            0 => *cell = LogOdds::OCCUPIED,
            1..4 => *cell = LogOdds::FREE,
            _ => {}
        }
    }
    grid
}

fn form(yaml: &str, image: &[u8]) -> Vec<u8> {
    let head = "multipart/form-data; boundary=x?frame_id=r1\n--x\r\nContent-Disposition: form-data; name=\"map\"; filename=\"m.yaml\"\r\n\r\n";
    let between = "\r\n--x\r\nContent-Disposition: form-data; name=\"image\"; filename=\"m.png\"\r\nContent-Type: image/png\r\n\r\n";
    [
        head.as_bytes(),
        yaml.as_bytes(),
        between.as_bytes(),
        image,
        b"\r\n--x--\r\n",
    ]
    .concat()
}
