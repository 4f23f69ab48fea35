//! Lines of text, each half as high as the one above, which show the smallest legible size (Schuetz
//! and Wimmer 2015, Figures 5 and 7).

/// The text, repeated along each line.
const WORDS: &str = "THE NEAREST POINT WINS ";

/// The number of lines, from the top; the first is half as high as the square.
const LINES: i32 = 8;

/// Rows and columns of a letter's cell; the last row and the last column are empty.
const CELL: (f64, u64) = (8.0, 6);

/// The rows of a letter, five columns each, the left one in the highest bit.
fn rows(letter: u8) -> [u8; 7] {
    match letter {
        b'T' => [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100],
        b'H' => [0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        b'E' => [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b11111],
        b'N' => [0b10001, 0b11001, 0b11001, 0b10101, 0b10011, 0b10011, 0b10001],
        b'A' => [0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
        b'R' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10100, 0b10010, 0b10001],
        b'S' => [0b01111, 0b10000, 0b10000, 0b01110, 0b00001, 0b00001, 0b11110],
        b'P' => [0b11110, 0b10001, 0b10001, 0b11110, 0b10000, 0b10000, 0b10000],
        b'O' => [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
        b'I' => [0b01110, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b01110],
        b'W' => [0b10001, 0b10001, 0b10001, 0b10101, 0b10101, 0b11011, 0b10001],
        _ => [0; 7],
    }
}

/// Whether there is ink at (x, y), measured from the left and the top of a square of side 1.
pub(super) fn ink(x: f64, y: f64) -> bool {
    let line = (-(1.0 - y).log2()).floor().clamp(0.0, f64::from(LINES - 1)) as i32;
    let height = (-f64::from(line) - 1.0).exp2();
    let unit = height / CELL.0;
    let row = ((y - (1.0 - 2.0 * height)) / unit) as usize;
    let column = (x / unit) as u64;
    let letter = WORDS.as_bytes()[(column / CELL.1) as usize % WORDS.len()];
    let place = column % CELL.1;
    place < 5 && rows(letter).get(row).is_some_and(|bits| bits >> (4 - place) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_written_and_each_is_half_as_high() {
        // The first line's T, H and the part of E that fits: a unit is a sixteenth of the square.
        let row =
            |y: f64| (0..16).map(|x| if ink((f64::from(x) + 0.5) / 16.0, y) { '#' } else { '.' }).collect::<String>();
        assert_eq!(row(0.5 / 16.0), "#####.#...#.####");
        assert_eq!(row(3.5 / 16.0), "..#...#####.####");
        assert_eq!(row(7.5 / 16.0), "................");
        // The second line repeats the first at half the size, and the last one ends with the
        // square.
        for k in 0..7 {
            let (x, y) = (0.3, 0.07 * f64::from(k));
            assert_eq!(ink(x, y), ink(0.5 * x, 0.5 + 0.5 * y));
        }
        assert!(!ink(1.0, 1.0) && !ink(0.0, 1.0));
    }
}
