//! The pages of E57 files: each holds 1020 bytes of content and a checksum of 4 bytes.

/// Content bytes of a page, without its checksum.
pub const CONTENT: usize = 1020;

/// Bytes of a page, with its checksum.
pub const PAGE: usize = 1024;

/// The checksum of a page's content: CRC-32C, big-endian.
pub fn checksum(content: &[u8]) -> [u8; 4] {
    let mut crc = !0u32;
    for byte in content {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0x82f6_3b78 & (crc & 1).wrapping_neg());
        }
    }
    (!crc).to_be_bytes()
}
