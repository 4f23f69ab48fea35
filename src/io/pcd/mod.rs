//! PCD, the format of the Point Cloud Library: version 0.7, and older versions where they agree.

mod body;
mod header;
mod lzf;
mod points;

use std::io::BufReader;

use crate::io::about::About;
use crate::io::fault::{self, Fault};
use crate::io::input::Local;
use crate::io::{Input, Points, ReadOptions};
use crate::{Progress, Result};
use header::{Data, Header};
use points::Columns;

/// Reads the points of a PCD file: `ascii`, `binary` or `binary_compressed`.
///
/// - `x y z` of any type become f64 positions. Organised clouds mark missing points by non-finite
///   coordinates.
/// - `normal_x normal_y normal_z`, or one field of three numbers, become normals.
/// - `rgb` or `rgba`, one number of 4 bytes of any type, becomes 8-bit sRGB codes: blue is the
///   lowest byte, then follow green and red. In `rgba` the highest byte is alpha; it is ignored if
///   it is 0 in the whole file. Some programs write these bytes as the value of a float, not as its
///   bits.
/// - `red green blue` with or without `alpha`, or one field of three or four numbers, become
///   colours according to the range of their values.
/// - `intensity` becomes grey if there are no colours, or all are zero.
///
/// Other common names of these fields are accepted; other fields are skipped. Coordinates stay
/// relative to the sensor, whose pose the line `VIEWPOINT` gives: most programs ignore it too.
///
/// # Errors
///
/// [`Error::Read`](crate::Error::Read) where the system cannot read.
/// [`Error::Malformed`](crate::Error::Malformed) where the header is invalid, `x`, `y` or `z` is
/// missing, the file holds fewer points than its header says, a number in text is invalid, or
/// compressed data cannot be decoded.
pub fn read(input: Input, options: &ReadOptions, progress: &dyn Progress) -> Result<Points> {
    let Local { file, length, path } = input.local()?;
    let in_file = |fault: Fault| fault.of(&path);
    let mut reader = BufReader::with_capacity(1 << 18, file);
    let header = header::read(&mut reader).map_err(in_file)?;
    let left = length.saturating_sub(header.bytes);
    progress.begin(&format!("reading {}", fault::name(&path)), header.points);
    let columns = Columns::of(&header, options).map_err(in_file)?;
    let about = options.describe.then(|| Box::new(about(&header, &columns)));
    let points = match header.data {
        Data::Ascii => body::ascii(reader, (&header, columns), left, progress),
        Data::Binary => body::binary(reader, (&header, columns), left, progress),
        Data::Compressed => body::compressed(reader, (&header, columns), left, progress),
    };
    progress.end();
    let mut points = points.map_err(in_file)?;
    points.raw.iter_mut().for_each(|raw| raw.name = fault::name(&path));
    points.about = about;
    Ok(points)
}

/// The file's description of itself.
fn about(header: &Header, columns: &Columns) -> About {
    let data = match header.data {
        Data::Ascii => "text",
        Data::Binary => "binary",
        Data::Compressed => "binary, compressed",
    };
    let image = header.image.map_or(String::new(), |[width, height]| format!(", an image of {width} x {height}"));
    let attributes = columns.attributes(header);
    About { format: format!("PCD, {data}{image}"), attributes, ..About::default() }
}
