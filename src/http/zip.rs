//! A ZIP archive of a few small files, stored without compression (APPNOTE 6.3.10): PNGs are compressed already.

/// An archive of these files, named without folders.
///
/// # Panics
/// When the files together have more than 4 GiB: the fused map's limit of cells lies far below.
pub(super) fn stored_zip(files: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut archive = Vec::new();
    let mut directory = Vec::new();
    for (name, content) in files {
        let offset = size(archive.len());
        let fields = common_fields(name, content);
        archive.extend_from_slice(&0x0403_4b50_u32.to_le_bytes());
        archive.extend_from_slice(&fields);
        archive.extend_from_slice(name.as_bytes());
        archive.extend_from_slice(content);

        directory.extend_from_slice(&0x0201_4b50_u32.to_le_bytes());
        directory.extend_from_slice(&20_u16.to_le_bytes()); // made by version 2.0
        directory.extend_from_slice(&fields);
        directory.extend_from_slice(&[0; 10]); // no comment, disk 0, no attributes
        directory.extend_from_slice(&offset.to_le_bytes());
        directory.extend_from_slice(name.as_bytes());
    }
    let (begin, length) = (size(archive.len()), size(directory.len()));
    let count = u16::try_from(files.len()).expect("invariant: a few files");
    archive.extend_from_slice(&directory);
    archive.extend_from_slice(&0x0605_4b50_u32.to_le_bytes());
    archive.extend_from_slice(&[0; 4]); // this disk, disk of the directory
    archive.extend_from_slice(&count.to_le_bytes());
    archive.extend_from_slice(&count.to_le_bytes());
    archive.extend_from_slice(&length.to_le_bytes());
    archive.extend_from_slice(&begin.to_le_bytes());
    archive.extend_from_slice(&[0; 2]); // no comment
    archive
}

/// What the local header and the directory's entry have in common.
fn common_fields(name: &str, content: &[u8]) -> Vec<u8> {
    let mut fields = Vec::with_capacity(26);
    fields.extend_from_slice(&20_u16.to_le_bytes()); // needs version 2.0
    fields.extend_from_slice(&0_u16.to_le_bytes()); // no flags
    fields.extend_from_slice(&0_u16.to_le_bytes()); // stored
    fields.extend_from_slice(&0_u16.to_le_bytes()); // midnight
    fields.extend_from_slice(&0x0021_u16.to_le_bytes()); // 1 January 1980: the same map, the same bytes
    fields.extend_from_slice(&crc32(content).to_le_bytes());
    fields.extend_from_slice(&size(content.len()).to_le_bytes());
    fields.extend_from_slice(&size(content.len()).to_le_bytes());
    let name = u16::try_from(name.len()).expect("invariant: short names");
    fields.extend_from_slice(&name.to_le_bytes());
    fields.extend_from_slice(&0_u16.to_le_bytes()); // no extra field
    fields
}

fn size(bytes: usize) -> u32 {
    u32::try_from(bytes).expect("invariant: less than 4 GiB")
}

/// CRC-32 (ISO 3309), by a table of the 256 bytes' remainders.
fn crc32(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = remainders();
    let step = |crc: u32, byte: &u8| TABLE[((crc ^ u32::from(*byte)) & 0xff) as usize] ^ (crc >> 8);
    !bytes.iter().fold(u32::MAX, step)
}

const fn remainders() -> [u32; 256] {
    let mut table = [0; 256];
    let mut index = 0;
    while index < 256 {
        #[expect(clippy::cast_possible_truncation, reason = "below 256")]
        let mut crc = index as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 {
                (crc >> 1) ^ 0xedb8_8320
            } else {
                crc >> 1
            };
            bit += 1;
        }
        table[index] = crc;
        index += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_crc_is_that_of_the_check_vector() {
        assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn an_archive_ends_with_a_directory_of_its_files() {
        let archive = stored_zip(&[("a.txt", b"hello".to_vec()), ("b.txt", Vec::new())]);
        let end = &archive[archive.len() - 22..];
        assert_eq!(end[..4], 0x0605_4b50_u32.to_le_bytes());
        assert_eq!(u16::from_le_bytes([end[10], end[11]]), 2);
        let begin = u32::from_le_bytes([end[16], end[17], end[18], end[19]]) as usize;
        assert_eq!(archive[begin..begin + 4], 0x0201_4b50_u32.to_le_bytes());
        assert_eq!(&archive[30 + 5..30 + 10], b"hello");
    }
}
