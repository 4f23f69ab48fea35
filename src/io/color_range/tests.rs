use super::*;

fn words(codes: Vec<[u16; 3]>) -> Points {
    let kind = Kind { zero_is_none: true, ..Kind::of(Number::WORD) };
    let count = codes.len();
    let numbers = Numbers { values: Values::Words(codes), kind, alpha: None };
    with(RawColors::of_run(count, Some(numbers), None))
}

fn with(raw: RawColors) -> Points {
    let count = raw.runs.iter().map(|run| run.count).sum();
    Points { positions: vec![[0.0; 3]; count], raw: Some(Box::new(raw)), ..Points::default() }
}

fn settled(mut points: Points) -> Option<Colors> {
    settle_colors(std::slice::from_mut(&mut points));
    assert!(points.raw.is_none());
    points.colors
}

fn of(integers: &[[u16; 3]], number: Number) -> Evidence {
    let values = Values::Words(integers.to_vec());
    Evidence::of(&Numbers { values, kind: Kind::of(number), alpha: None })
}

#[test]
fn eight_bit_codes_are_recognised() {
    let expected = Some(Colors::Srgb8(vec![[1, 2, 3, 255], [255, 0, 128, 255]]));
    for scale in [1, 256, 257] {
        let codes = vec![[1, 2, 3].map(|v| v * scale), [255, 0, 128].map(|v| v * scale)];
        assert_eq!(settled(words(codes)), expected, "{scale}");
    }
    assert_eq!(settled(words(vec![[0; 3]; 4])), None);
    assert_eq!(settled(words(vec![])), None);
}

#[test]
fn rules_are_decided_once() {
    let mut rules = ColorRules::default();
    rules.settle(std::slice::from_mut(&mut words(vec![[1, 2, 255]])));
    let mut later = words(vec![[300, 65535, 12345]]);
    rules.settle(std::slice::from_mut(&mut later));
    assert_eq!(later.colors, Some(Colors::Srgb8(vec![[255; 4]])));
    assert!(later.notes.iter().any(|note| note.contains("above 255")), "{:?}", later.notes);
    let alone = settled(words(vec![[300, 65535, 12345]]));
    assert!(matches!(alone, Some(Colors::Linear(_))));
}

#[test]
fn one_of_a_hundred_is_an_outlier_and_two_are_not() {
    let rule = |outliers: usize, largest: u16| {
        let mut codes = vec![[200; 3]; 100];
        codes.as_flattened_mut()[..outliers].fill(largest);
        Rule::of(&Kind::of(Number::WORD), &of(&codes, Number::WORD))
    };
    assert_eq!((rule(0, 0), rule(3, 256), rule(3, 65535)), (Rule::Bytes, Rule::Bytes, Rule::Bytes));
    assert_eq!(rule(4, 300), Rule::Codes([(0.0, 65535.0); 3]));
    let mut widened = vec![[257 * 77; 3]; 100];
    widened.as_flattened_mut()[..3].fill(1234);
    assert_eq!(Rule::of(&Kind::of(Number::WORD), &of(&widened, Number::WORD)), Rule::HighBytes);
    widened[50] = [1234; 3];
    assert_eq!(Rule::of(&Kind::of(Number::WORD), &of(&widened, Number::WORD)), Rule::Codes([(0.0, 65535.0); 3]));
}

/// Runs of one file are joined: points without a colour get the default grey.
#[test]
fn runs_are_joined() {
    let kind = Kind::of(Number::Byte);
    let bytes = Numbers { values: Values::Bytes(vec![[1, 2, 3, 255]; 2]), kind, alpha: None };
    let none = Run { count: 1, colors: None, shades: None };
    let colored = Run { count: 2, colors: Some(bytes), shades: None };
    let joined = settled(with(RawColors { runs: vec![none.clone(), colored.clone()], ..RawColors::default() }));
    assert_eq!(joined, Some(Colors::Srgb8(vec![[218, 218, 218, 255], [1, 2, 3, 255], [1, 2, 3, 255]])));
    let shades = Run { shades: Some(Shades::Words(vec![0, 10])), count: 2, ..none };
    let joined = settled(with(RawColors { runs: vec![colored, shades], ..RawColors::default() }));
    let Some(Colors::Srgb8(codes)) = joined else { unreachable!() };
    assert_eq!(codes[2..], [[0, 0, 0, 255], [255; 4]]);
}

#[test]
fn glints_do_not_set_white() {
    let mut intensities: Vec<u16> = (0..2000).map(|i| i % 101).collect();
    intensities.push(60000);
    let shades = |values: Vec<f32>| Shades::Floats { values, integer: false };
    let floats = shades(intensities.iter().map(|value| f32::from(*value) / 64.0 + 0.001).collect());
    for shades in [Shades::Words(intensities), floats] {
        let Some(Colors::Srgb8(codes)) = settled(with(RawColors::of_run(2001, None, Some(shades)))) else {
            unreachable!()
        };
        assert_eq!((codes[0][0], codes[100], codes[2000]), (0, [255; 4], [255; 4]));
        assert!(codes[50][0].abs_diff(128) < 2, "{:?}", codes[50]);
    }
    let mostly_dark = settled(with(RawColors::of_run(
        3000,
        None,
        Some(Shades::Words((0..3000).map(|i| u16::from(i == 5) * 9).collect())),
    )));
    assert!(matches!(mostly_dark, Some(Colors::Srgb8(codes)) if codes[5] == [255; 4] && codes[6] == [0, 0, 0, 255]));
    for same in [vec![7.0; 9], vec![], vec![f32::NAN, f32::INFINITY, 3.0]] {
        assert_eq!(settled(with(RawColors::of_run(same.len(), None, Some(shades(same))))), None);
    }
}
