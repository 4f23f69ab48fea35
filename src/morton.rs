//! Morton codes: the bits of three coordinates, interleaved.

/// Inserts two zeros before each bit of a number, which is clamped to 21 bits.
pub(crate) fn spread(x: u64) -> u64 {
    let mut x = x.min(0x1f_ffff);
    x = (x | x << 32) & 0x1f_0000_0000_ffff;
    x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// The Morton code of a cell: x in the lowest bit, then y, then z. Coordinates are clamped to 21
/// bits.
pub(crate) fn code([x, y, z]: [u64; 3]) -> u64 {
    spread(x) | spread(y) << 1 | spread(z) << 2
}
