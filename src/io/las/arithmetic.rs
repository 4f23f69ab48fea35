//! The entropy coder of LAZ, as far as chunk tables use it: adaptive arithmetic decoding of 32-bit
//! integers (Said 2004, "Introduction to Arithmetic Coding"; Isenburg 2013, "LASzip: lossless
//! compression of LiDAR data").

use std::io::{self, Read};

/// Shortest interval; when it is shorter, the decoder reads another byte.
const MIN_LENGTH: u32 = 1 << 24;
/// Fractional bits of a symbol's probability.
const SYMBOL_BITS: u32 = 15;
/// Fractional bits of the probability of a zero bit.
const BIT_BITS: u32 = 13;
/// Widest corrector (coded difference) that is coded as one symbol, bits. In a wider corrector,
/// only the top eight bits are a symbol.
const SYMBOL_WIDTH: u32 = 8;

/// Adaptive probabilities of symbols.
#[derive(Debug)]
struct SymbolModel {
    counts: Vec<u32>,
    /// For each symbol, the sum of the probabilities of all symbols before it, in units of 2^-15.
    starts: Vec<u32>,
    total: u32,
    cycle: u32,
    until_update: u32,
}

impl SymbolModel {
    fn new(symbols: u32) -> Self {
        let count = symbols as usize;
        let mut model =
            Self { counts: vec![1; count], starts: vec![0; count], total: 0, cycle: symbols, until_update: 0 };
        model.update();
        model.cycle = (symbols + 6) >> 1;
        model.until_update = model.cycle;
        model
    }

    fn update(&mut self) {
        self.total += self.cycle;
        if self.total > 1 << SYMBOL_BITS {
            self.counts.iter_mut().for_each(|count| *count = (*count + 1) >> 1);
            self.total = self.counts.iter().sum();
        }
        let scale = (1 << 31) / self.total.max(1);
        let mut sum = 0u32;
        for (start, count) in self.starts.iter_mut().zip(&self.counts) {
            *start = scale.wrapping_mul(sum) >> (31 - SYMBOL_BITS);
            sum += count;
        }
        let longest = (self.counts.len() as u32 + 6) << 3;
        self.cycle = ((5 * self.cycle) >> 2).min(longest);
        self.until_update = self.cycle;
    }
}

/// The adaptive probability of a zero bit.
#[derive(Debug)]
struct BitModel {
    zeros: u32,
    total: u32,
    /// The probability of a zero bit, in units of 2^-13.
    zero_share: u32,
    cycle: u32,
    until_update: u32,
}

impl BitModel {
    fn new() -> Self {
        Self { zeros: 1, total: 2, zero_share: 1 << (BIT_BITS - 1), cycle: 4, until_update: 4 }
    }

    fn update(&mut self) {
        self.total += self.cycle;
        if self.total > 1 << BIT_BITS {
            self.total = (self.total + 1) >> 1;
            self.zeros = (self.zeros + 1) >> 1;
            if self.zeros == self.total {
                self.total += 1;
            }
        }
        self.zero_share = self.zeros.wrapping_mul((1 << 31) / self.total) >> (31 - BIT_BITS);
        self.cycle = ((5 * self.cycle) >> 2).min(64);
        self.until_update = self.cycle;
    }
}

/// The state of the decoder: the interval that the bytes read so far have narrowed down.
#[derive(Debug)]
struct Decoder<R> {
    bytes: R,
    value: u32,
    length: u32,
}

impl<R: Read> Decoder<R> {
    fn new(mut bytes: R) -> io::Result<Self> {
        let mut first = [0; 4];
        bytes.read_exact(&mut first)?;
        Ok(Self { bytes, value: u32::from_be_bytes(first), length: u32::MAX })
    }

    fn renormalize(&mut self) -> io::Result<()> {
        while self.length < MIN_LENGTH {
            let mut byte = [0];
            self.bytes.read_exact(&mut byte)?;
            self.value = (self.value << 8) | u32::from(byte[0]);
            // In a valid stream the length never reaches 0; in a corrupt one, `max(1)` ends the
            // loop.
            self.length = (self.length << 8).max(1);
        }
        Ok(())
    }

    fn bit(&mut self, model: &mut BitModel) -> io::Result<u32> {
        let split = model.zero_share.wrapping_mul(self.length >> BIT_BITS);
        let bit = u32::from(self.value >= split);
        if bit == 0 {
            self.length = split;
            model.zeros += 1;
        } else {
            self.value -= split;
            self.length = self.length.wrapping_sub(split);
        }
        self.renormalize()?;
        model.until_update -= 1;
        if model.until_update == 0 {
            model.update();
        }
        Ok(bit)
    }

    fn symbol(&mut self, model: &mut SymbolModel) -> io::Result<u32> {
        let unit = self.length >> SYMBOL_BITS;
        // The last symbol whose start is not above the value; the first one starts at 0.
        let symbol = model.starts.partition_point(|start| start.wrapping_mul(unit) <= self.value).saturating_sub(1);
        let start = model.starts.get(symbol).map_or(0, |start| start.wrapping_mul(unit));
        let end = model.starts.get(symbol + 1).map_or(self.length, |end| end.wrapping_mul(unit));
        self.value = self.value.wrapping_sub(start);
        self.length = end.wrapping_sub(start);
        self.renormalize()?;
        if let Some(count) = model.counts.get_mut(symbol) {
            *count += 1;
        }
        model.until_update -= 1;
        if model.until_update == 0 {
            model.update();
        }
        Ok(symbol as u32)
    }

    /// Decodes `count` bits, at most 32, whose values are all equally probable.
    fn bits(&mut self, count: u32) -> io::Result<u32> {
        if count > 19 {
            let low = self.bits(16)?;
            return Ok(self.bits(count - 16)? << 16 | low);
        }
        let unit = (self.length >> count).max(1);
        let bits = self.value / unit;
        self.value -= unit * bits;
        self.length = unit;
        self.renormalize()?;
        Ok(bits)
    }
}

/// Decodes integers as differences to a prediction. Each context has its own statistics of the
/// widths of differences.
#[derive(Debug)]
pub(super) struct Integers<R> {
    decoder: Decoder<R>,
    widths: Vec<SymbolModel>,
    sign: BitModel,
    correctors: Vec<SymbolModel>,
}

impl<R: Read> Integers<R> {
    pub(super) fn new(bytes: R, contexts: usize) -> io::Result<Self> {
        Ok(Self {
            decoder: Decoder::new(bytes)?,
            widths: (0..contexts).map(|_| SymbolModel::new(33)).collect(),
            sign: BitModel::new(),
            correctors: (1..=32u32).map(|width| SymbolModel::new(1 << width.min(SYMBOL_WIDTH))).collect(),
        })
    }

    /// Decodes the next integer, given its prediction.
    pub(super) fn next(&mut self, predicted: i32, context: usize) -> io::Result<i32> {
        let (Some(widths), invalid) = (self.widths.get_mut(context), io::ErrorKind::InvalidData) else {
            return Err(io::ErrorKind::InvalidInput.into());
        };
        let width = self.decoder.symbol(widths)?;
        let corrector = match width {
            0 => self.decoder.bit(&mut self.sign)? as i32,
            32 => i32::MIN,
            _ => {
                let model = self.correctors.get_mut(width as usize - 1).ok_or(invalid)?;
                let mut corrector = self.decoder.symbol(model)?;
                if width > SYMBOL_WIDTH {
                    let lower = width - SYMBOL_WIDTH;
                    corrector = corrector << lower | self.decoder.bits(lower)?;
                }
                // Width k covers the values -(2^k - 1) ..= -2^(k-1) and 2^(k-1) + 1 ..= 2^k.
                if corrector >= 1 << (width - 1) {
                    corrector.wrapping_add(1) as i32
                } else {
                    corrector.wrapping_sub((1 << width) - 1) as i32
                }
            }
        };
        Ok(predicted.wrapping_add(corrector))
    }
}
