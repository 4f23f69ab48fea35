//! The coordinate system that the records of a LAS file name, by text (WKT) or by GeoTIFF keys.

use crate::io::place::GeoKeys;
use las::raw::Vlr;
use std::io::{Read, Seek, SeekFrom};

/// User and ids of the records: GeoTIFF keys, the texts of keys, and well-known text.
const USER: &[u8] = b"LASF_Projection";
const KEYS: u16 = 34735;
const DOUBLES: u16 = 34736;
const TEXTS: u16 = 34737;
const TEXT: u16 = 2112;

/// GeoTIFF keys: the kind of model, its codes, and texts that name it.
const MODEL: u16 = 1024;
const GEOGRAPHIC: u16 = 2048;
const PROJECTED: u16 = 3072;
const CITATIONS: [u16; 3] = [3073, 1026, 2049];

/// The keys of which a coordinate system has at least one.
const MODELS: [u16; 3] = [MODEL, GEOGRAPHIC, PROJECTED];

/// The kind of model whose coordinates are degrees; others are projected or geocentric.
const MODEL_OF_DEGREES: u16 = 2;

/// The code that means that a system has none.
const USER_DEFINED: u16 = 32767;

/// Longest text that is read, bytes, and the number of extended records that are looked at.
const LONGEST: u64 = 1 << 20;
const MOST_EXTENDED: u32 = 64;

/// Size of the header of an extended record, bytes.
const EXTENDED_HEADER: u64 = 60;

/// The records that describe the coordinate system.
#[derive(Clone, Debug, Default)]
pub(super) struct Records {
    keys: Vec<u16>,
    doubles: Vec<f64>,
    texts: Vec<u8>,
    pub text: Option<String>,
}

impl Records {
    pub fn take(&mut self, record: &Vlr) {
        self.take_data(&record.user_id, record.record_id, &record.data);
    }

    fn take_data(&mut self, user: &[u8], id: u16, data: &[u8]) {
        if user.split(|byte| *byte == 0).next() != Some(USER) {
            return;
        }
        match id {
            KEYS => self.keys = data.as_chunks().0.iter().map(|word| u16::from_le_bytes(*word)).collect(),
            DOUBLES => self.doubles = data.as_chunks().0.iter().map(|number| f64::from_le_bytes(*number)).collect(),
            TEXTS => self.texts = data.to_vec(),
            TEXT => {
                let text = data.split(|byte| *byte == 0).next().unwrap_or_default();
                let text = String::from_utf8_lossy(text).trim().to_owned();
                self.text = (!text.is_empty()).then_some(text);
            }
            _ => {}
        }
    }

    /// Returns the keys of the horizontal coordinate system: those of the file, or else the EPSG
    /// code in the text. None if the records give neither.
    pub fn geo_keys(&self) -> Option<GeoKeys> {
        self.own_keys().or_else(|| {
            let text = self.text.as_deref()?;
            let (system, geographic) = horizontal(text)?;
            Some(GeoKeys::of_code(code_of_whole(system)?.parse().ok()?, geographic))
        })
    }

    /// Returns the keys of the file as they are, if there are any.
    fn own_keys(&self) -> Option<GeoKeys> {
        let &[_, _, _, count] = self.keys.first_chunk::<4>()?;
        let entries: Vec<[u16; 4]> = self.keys.as_chunks::<4>().0.iter().skip(1).take(count.into()).copied().collect();
        // Texts of keys are ASCII; each key refers to them by position.
        let end = self.texts.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        let texts = self.texts[..end].iter().map(|byte| if (32..127).contains(byte) { char::from(*byte) } else { '?' });
        let keys = GeoKeys { entries, doubles: self.doubles.clone(), texts: texts.collect() };
        keys.entries.iter().any(|entry| MODELS.contains(&entry[0])).then_some(keys)
    }

    /// Looks for a text among extended records; ignores those that cannot be read.
    pub fn look_in_extended(&mut self, file: &mut (impl Read + Seek), mut at: u64, count: u32) {
        for _ in 0..count.min(MOST_EXTENDED) {
            let mut head = [0; EXTENDED_HEADER as usize];
            if file.seek(SeekFrom::Start(at)).is_err() || file.read_exact(&mut head).is_err() {
                return;
            }
            let [_, _, user @ .., _, _] = &head[..20] else { return };
            let id = u16::from_le_bytes([head[18], head[19]]);
            let length = head[20..28].first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
            if id == TEXT && length <= LONGEST {
                let mut data = Vec::new();
                if file.take(length).read_to_end(&mut data).is_ok() {
                    self.take_data(user, id, &data);
                }
            }
            at = at.saturating_add(EXTENDED_HEADER).saturating_add(length);
        }
    }
}

/// The EPSG code of the coordinate system as a whole: the last entry before `]]` at the end of the
/// text. The codes of its parts are followed by more brackets.
fn code_of_whole(text: &str) -> Option<&str> {
    let inner = text.strip_suffix("]]")?.trim_end_matches('"');
    let digits = inner.len() - inner.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let (start, code) = inner.split_at(inner.len() - digits);
    let start = start.trim_end_matches(['"', ' ']).to_ascii_uppercase();
    let is_code = start.ends_with("AUTHORITY[\"EPSG\",") || start.ends_with("ID[\"EPSG\",");
    (is_code && digits > 0).then_some(code)
}

/// Returns the part of a text that describes the horizontal system, and whether its coordinates are
/// degrees. Texts may join it with a vertical system.
fn horizontal(text: &str) -> Option<(&str, bool)> {
    let upper = text.to_ascii_uppercase();
    let words = [("PROJCS[", false), ("PROJCRS[", false), ("PROJECTEDCRS[", false)];
    let degrees = [("GEOGCS[", true), ("GEOGCRS[", true), ("GEODCRS[", true), ("GEOGRAPHICCRS[", true)];
    let found = |(word, geographic): &(&str, bool)| {
        let start = upper.find(word)?;
        Some((part(text.get(start..)?)?, *geographic))
    };
    words.iter().chain(&degrees).find_map(found)
}

/// Returns the start of a text up to the bracket that closes its first one.
fn part(text: &str) -> Option<&str> {
    let (mut depth, mut quoted) = (0u32, false);
    for (at, byte) in text.bytes().enumerate() {
        match byte {
            b'"' => quoted = !quoted,
            b'[' if !quoted => depth += 1,
            b']' if !quoted => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return text.get(..=at);
                }
            }
            _ => {}
        }
    }
    None
}

/// A coordinate system.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct System {
    pub name: String,
    /// Whether its coordinates are degrees, if that is known.
    pub geographic: Option<bool>,
}

impl System {
    pub fn of(records: &Records) -> Option<Self> {
        records.text.as_deref().map(Self::of_text).or_else(|| Self::of_keys(&records.keys, &records.texts))
    }

    /// Parses well-known text of version 1 or 2.
    fn of_text(text: &str) -> Self {
        let upper = text.to_ascii_uppercase();
        let has = |word: &str| upper.contains(word);
        let projected = has("PROJCS[") || has("PROJCRS[") || has("PROJECTEDCRS[") || has("LOCAL_CS[") || has("ENGCRS[");
        let degrees = has("GEOGCS[") || has("GEOGCRS[") || has("GEODCRS[") || has("GEOGRAPHICCRS[");
        let geographic = if projected { Some(false) } else { (degrees && !has("GEOCCS[")).then_some(true) };
        let name = text.split('"').nth(1).unwrap_or(text).trim();
        let code = code_of_whole(text.trim_end());
        let name: String = name.chars().take(120).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
        Self { name: code.map_or(name.clone(), |code| format!("{name} (EPSG:{code})")), geographic }
    }

    /// Parses GeoTIFF keys: four numbers each, after four numbers of the directory.
    fn of_keys(keys: &[u16], texts: &[u8]) -> Option<Self> {
        let entries = || keys.as_chunks::<4>().0.iter().skip(1);
        let value = |id: u16| entries().find(|key| key[0] == id && key[1] == 0).map(|key| key[3]);
        let citation = |id: u16| {
            let [_, _, count, at] = *entries().find(|key| key[0] == id && key[1] == TEXTS)?;
            let text = texts.get(usize::from(at)..usize::from(at) + usize::from(count))?;
            let text = String::from_utf8_lossy(text);
            let text = text.trim_end_matches(['|', '\0']).trim();
            let text: String = text.chars().take(120).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
            (!text.is_empty()).then_some(text)
        };
        let is_code = |code: &u16| *code != 0 && *code != USER_DEFINED;
        let code = value(PROJECTED).filter(is_code).or_else(|| value(GEOGRAPHIC).filter(is_code));
        let name = CITATIONS.iter().find_map(|id| citation(*id));
        let name = match (name, code) {
            (Some(name), Some(code)) => format!("{name} (EPSG:{code})"),
            (Some(name), None) => name,
            (None, Some(code)) => format!("EPSG:{code}"),
            (None, None) => return None,
        };
        Some(Self { name, geographic: value(MODEL).map(|model| model == MODEL_OF_DEGREES) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_copied_or_come_from_the_code_of_the_horizontal_system() {
        let record = |text: &str| Records { text: Some(text.into()), ..Records::default() }.geo_keys();
        let utm = r#"PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],UNIT["metre",1],AUTHORITY["EPSG","32632"]]"#;
        let height = r#"VERT_CS["EGM96 [m]",AUTHORITY["EPSG","5773"]]"#;
        let compound = format!(r#"COMPD_CS["both",{utm},{height},AUTHORITY["EPSG","1"]]"#);
        assert_eq!(record(utm), Some(GeoKeys::of_code(32632, false)));
        assert_eq!(record(&compound), Some(GeoKeys::of_code(32632, false)));
        let degrees = r#"GEOGCRS["WGS 84 [x]",DATUM["World Geodetic System 1984"],ID["EPSG",4326]]"#;
        assert_eq!(record(degrees), Some(GeoKeys::of_code(4326, true)));
        // The code of a part of the system is not its own.
        assert_eq!(record(r#"PROJCS["own",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],UNIT["metre",1]]"#), None);
        assert_eq!(record("PROJCS[\"broken"), None);
        let keys = vec![1, 1, 0, 2, MODEL, 0, 1, 1, 3072, 0, 1, 25832, 0, 0, 0, 0];
        let records = Records { keys, doubles: vec![0.5], texts: b"ETRS|\0\0".to_vec(), ..Records::default() };
        let entries = vec![[MODEL, 0, 1, 1], [3072, 0, 1, 25832]];
        assert_eq!(records.geo_keys(), Some(GeoKeys { entries, doubles: vec![0.5], texts: "ETRS|".into() }));
    }

    #[test]
    fn systems_are_named_and_degrees_known() {
        let utm = r#"PROJCS["WGS 84 / UTM zone 32N",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],UNIT["metre",1],AUTHORITY["EPSG","32632"]]"#;
        let expected = System { name: "WGS 84 / UTM zone 32N (EPSG:32632)".into(), geographic: Some(false) };
        assert_eq!(System::of_text(utm), expected);
        let degrees = r#"GEOGCRS["WGS 84",DATUM["World Geodetic System 1984"],ID["EPSG",4326]]"#;
        let expected = System { name: "WGS 84 (EPSG:4326)".into(), geographic: Some(true) };
        assert_eq!(System::of_text(degrees), expected);
        // The code of a unit is not that of the coordinate system.
        let feet = r#"PROJCS["Lambert",GEOGCS["NAD83"],UNIT["foot",0.3048,AUTHORITY["EPSG","9002"]]]"#;
        assert_eq!(System::of_text(feet), System { name: "Lambert".into(), geographic: Some(false) });
        let keys = [1, 1, 0, 3, MODEL, 0, 1, 1, PROJECTED, 0, 1, 25832, 3073, TEXTS, 6, 0];
        let expected = System { name: "ETRS (EPSG:25832)".into(), geographic: Some(false) };
        assert_eq!(System::of_keys(&keys, b"ETRS |"), Some(expected));
        let keys = [1, 1, 0, 2, MODEL, 0, 1, 2, GEOGRAPHIC, 0, 1, 4326];
        assert_eq!(System::of_keys(&keys, b""), Some(System { name: "EPSG:4326".into(), geographic: Some(true) }));
        assert_eq!(System::of_keys(&[], b""), None);
    }
}
