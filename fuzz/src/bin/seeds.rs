//! Writes a small corpus for each target into the folder that is its argument.

use std::error::Error;
use std::fs;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("seeds FOLDER: the folder is missing")?;
    for (target, name, bytes) in mapweld_fuzz::seeds() {
        let to = Path::new(&folder).join(target);
        fs::create_dir_all(&to)?;
        fs::write(to.join(name), bytes)?;
    }
    Ok(())
}
