//! The pages of E57 files: 1020 bytes and their checksum.

/// Bytes of a page before its checksum.
pub const CONTENT: usize = 1020;

/// Bytes of a page.
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
