//! Compares images that must be bit-identical.
//!
//! Each deterministic accumulator must give the same image in two frames of one renderer and in a
//! frame of a second renderer. The accumulator `fixed` must also give it with each organisation,
//! without each optimisation, and from surfels in reverse order.

use std::time::Instant;

use serde::Serialize;

use super::{Card, sphere};
use crate::error::Result;
use crate::frame::Frame;
use crate::plan::{ACCUMULATORS, Accumulator, Optimisation, Organisation, Settings, check as possible};
use crate::render::{Backend, Renderer};
use crate::scene::{Colors, Maps, Scene};

/// The fraction of the remaining time that this step may use.
const SHARE: f64 = 0.4;

/// Number of surfels, and side of the image in pixels: full run, quick run. The full run has enough
/// surfels for batches to be culled.
const SIZES: [(u64, u32); 2] = [(200_000, 1024), (5_000, 160)];

/// Mean splat radii, pixels: small splats, and splats so large that tiles or workgroups draw them.
const FOOTPRINTS: [f64; 2] = [1.5, 12.0];

/// A comparison of two images that must be bit-identical.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The scene, in words.
    pub scene: String,
    /// The name of the accumulator.
    pub accumulator: &'static str,
    /// How the second image was made; the first is a plain frame with the same accumulator.
    pub what: String,
    /// Number of compared values: four of the colour and those of the maps, over all pixels.
    pub values: u64,
    /// Number of values whose bits differ. Equals `values` if the images differ in size or maps.
    pub differing: u64,
    /// Whether no value differs.
    pub equal: bool,
}

impl Comparison {
    /// Compares the image `found`, which was made as `what` says, with the image `expected`.
    pub fn of(
        (scene, accumulator): (&str, Accumulator),
        what: impl Into<String>,
        expected: &Frame,
        found: &Frame,
    ) -> Self {
        let values = bits(expected).count().max(bits(found).count()) as u64;
        let alike = (expected.width, expected.height, expected.maps()) == (found.width, found.height, found.maps());
        let differing = bits(expected).zip(bits(found)).filter(|(a, b)| a != b).count() as u64;
        let differing = if alike { differing } else { values };
        Self {
            scene: scene.to_owned(),
            accumulator: accumulator.name(),
            what: what.into(),
            values,
            differing,
            equal: differing == 0,
        }
    }
}

/// Iterates over a frame's values as bits: as floats, -0 would equal 0 and NaN would differ from
/// itself.
fn bits(frame: &Frame) -> impl Iterator<Item = u32> + '_ {
    let maps = frame.maps().iter().collect::<Vec<_>>().into_iter().filter_map(|map| frame.map(map));
    frame.color.iter().flatten().chain(maps.flatten()).map(|value| value.to_bits())
}

/// Renders and compares as many images as the time allows.
pub(super) fn check(card: &mut Card<'_>) -> Result<()> {
    let deadline = card.budget.share(SHARE);
    let (count, side) = SIZES[usize::from(card.asked.quick)];
    for row in ACCUMULATORS.iter().filter(|row| row.deterministic) {
        if let Some(why) = lacks(&card.record.adapter, row.of) {
            card.leave_out(why);
        }
    }
    for footprint in FOOTPRINTS {
        let staged = sphere(count, Some(footprint), side, card.told.progress)?;
        let name = format!("{count} surfels of {footprint} px, {side}x{side}");
        of_scene(card, &name, (&staged.scene, &staged.cameras[0]), deadline)?;
    }
    let all = &card.record.determinism;
    let equal = all.iter().filter(|comparison| comparison.equal).count();
    (card.told.say)(&format!("  {equal} of {} comparisons are equal", all.len()));
    Ok(())
}

/// Returns the reason why the adapter cannot run an accumulator, if there is one.
fn lacks(adapter: &crate::gpu::AdapterDescription, accumulator: Accumulator) -> Option<String> {
    possible::sums(adapter, accumulator).err().map(|error| format!("determinism of {accumulator}: {error}"))
}

fn of_scene(
    card: &mut Card<'_>,
    name: &str,
    (scene, camera): (&Scene, &crate::scene::Camera),
    deadline: Instant,
) -> Result<()> {
    let variants = variants();
    let able = |accumulator: &Accumulator| lacks(&card.record.adapter, *accumulator).is_none();
    let accumulators: Vec<_> =
        ACCUMULATORS.iter().filter(|row| row.deterministic).map(|row| row.of).filter(able).collect();
    let reversed = reversed(scene);
    card.told.progress.begin("comparing images", (accumulators.len() + variants.len()) as u64);
    let Card { backend, record, told, .. } = card;
    let backend: &Backend = backend;
    let frame = |scene: &Scene, options: &Settings| {
        Renderer::new(scene, options, backend)?.frame(camera, &()).map(|(frame, _)| frame)
    };
    let mut plain = None;
    let mut late = Vec::new();
    for accumulator in accumulators {
        if Instant::now() >= deadline {
            late.push(accumulator.name().to_owned());
            continue;
        }
        let mut renderer = Renderer::new(scene, &options(accumulator), backend)?;
        let (first, _) = renderer.frame(camera, &())?;
        let (second, _) = renderer.frame(camera, &())?;
        let again = frame(scene, &options(accumulator))?;
        for (what, found) in [("the second frame", second), ("another renderer", again)] {
            record.determinism.push(Comparison::of((name, accumulator), what, &first, &found));
        }
        if accumulator == Accumulator::Fixed {
            record.bits.insert(name.to_owned(), first.hashes());
            plain = Some(first);
        }
        told.progress.advance(1);
    }
    for Variant { what, options, reverse } in variants {
        let Some(plain) = plain.as_ref().filter(|_| Instant::now() < deadline) else {
            late.push(what);
            continue;
        };
        let found = frame(if reverse { &reversed } else { scene }, &options)?;
        record.determinism.push(Comparison::of((name, Accumulator::Fixed), what, plain, &found));
        told.progress.advance(1);
    }
    told.progress.end();
    if !late.is_empty() {
        card.leave_out(format!("determinism on {name}, as the time was over: {}", late.join(", ")));
    }
    Ok(())
}

fn options(accumulator: Accumulator) -> Settings {
    Settings { accumulator, maps: Maps::ON_DEVICE, ..Settings::default() }
}

/// A way to render that must give the same image as the default settings with `fixed`.
struct Variant {
    what: String,
    options: Settings,
    /// Whether the surfels are in reverse order.
    reverse: bool,
}

fn variants() -> Vec<Variant> {
    let plain = || options(Accumulator::Fixed);
    let variant = |what: &str, options| Variant { what: what.to_owned(), options, reverse: false };
    let organised = |organisation| Settings { organisation, ..plain() };
    let without = |without| Settings { without, ..plain() };
    let all = Optimisation::ALL.map(|(optimisation, _)| optimisation).to_vec();
    let mut variants = vec![
        variant("organisation scatter", organised(Organisation::Scatter)),
        variant("organisation tile", organised(Organisation::Tile)),
    ];
    for (optimisation, name) in Optimisation::ALL {
        variants.push(variant(&format!("without {name}"), without(vec![optimisation])));
    }
    variants.push(variant("without any optimisation", without(all)));
    // Leaves out the optimisation `order`, which would sort both scenes into the same order.
    let options = without(vec![Optimisation::Order]);
    variants.push(Variant { what: "surfels in reverse, without order".into(), options, reverse: true });
    variants
}

/// Returns the scene with its surfels in reverse order.
fn reversed(scene: &Scene) -> Scene {
    let mut reversed = scene.clone();
    reversed.surfels.reverse();
    reversed.low.reverse();
    match &mut reversed.colors {
        Colors::Srgb8(colors) => colors.reverse(),
        Colors::Linear(colors) => colors.reverse(),
        // A constant colour needs no reversal; generated scenes have no textures or harmonics.
        Colors::Constant(_) | Colors::Textured(_) | Colors::Harmonics(_) => {}
    }
    reversed
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::scene::Map;

    #[test]
    fn a_changed_bit_is_noticed() {
        let staged = sphere(300, Some(3.0), 24, &()).unwrap();
        let of = |scene: &Scene| {
            let mut renderer = Renderer::new(scene, &options(Accumulator::Fixed), &Backend::Reference).unwrap();
            renderer.frame(&staged.cameras[0], &()).unwrap().0
        };
        let compare = |found: &Frame| Comparison::of(("s", Accumulator::Fixed), "w", &of(&staged.scene), found);
        let same = compare(&of(&staged.scene));
        assert!(same.equal && same.differing == 0 && same.values == 24 * 24 * (4 + 1 + 3 + 1 + 1), "{same:?}");
        // Flips one bit of a colour, one bit of each map, and the sign of a zero.
        let flip = |value: &mut f32| *value = f32::from_bits(value.to_bits() ^ 1);
        let mut changed = of(&staged.scene);
        flip(&mut changed.color[300][1]);
        assert_eq!((compare(&changed).differing, compare(&changed).equal), (1, false));
        for map in [Map::Depth, Map::Normal, Map::Weight, Map::Count] {
            let mut changed = of(&staged.scene);
            flip(&mut changed.map_mut(map).unwrap()[301]);
            assert_eq!(compare(&changed).differing, 1, "{map:?}");
        }
        let mut changed = of(&staged.scene);
        assert_eq!(changed.color[0], [0.0; 4]);
        changed.color[0][0] = -0.0;
        assert_eq!(compare(&changed).differing, 1);
        // An image without one of the maps differs.
        assert!(!compare(&of(&staged.scene).without(Map::Depth)).equal);
    }

    #[test]
    fn every_optimisation_is_left_out_once_and_all_are_together() {
        let variants = variants();
        for (optimisation, _) in Optimisation::ALL {
            assert!(variants.iter().any(|variant| variant.options.without == [optimisation]), "{optimisation:?}");
        }
        assert!(variants.iter().any(|variant| variant.options.without.len() == Optimisation::ALL.len()));
        assert_eq!(variants.iter().filter(|variant| variant.reverse).count(), 1);
        let staged = sphere(50, None, 16, &()).unwrap();
        let back = reversed(&staged.scene);
        assert_eq!(back.surfels[0], staged.scene.surfels[49]);
        assert_eq!(reversed(&back), staged.scene);
    }
}
