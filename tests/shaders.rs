//! Every kernel that any needs can reach is valid, portable WGSL, and host and device agree about what is set.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::collections::{BTreeMap, BTreeSet};

use epsplat::gpu::Sources;
use epsplat::gpu::device::STORAGE_BUFFERS;
use epsplat::gpu::kernel::{FILES, STAGES, files, overrides, reflect};
use epsplat::scene::RenderOptions;
use naga::AddressSpace;
use naga::valid::{Capabilities, ValidationFlags, Validator};

/// Storage buffers per stage that core WebGPU grants.
const CORE_STORAGE_BUFFERS: usize = 8;

#[test]
fn every_combination_is_valid_without_any_feature() {
    let sources = Sources::default();
    let texts: BTreeSet<String> = common::all_needs().iter().map(|needs| sources.join(needs)).collect();
    assert!(texts.len() > 100, "{}", texts.len());
    for text in &texts {
        let module = naga::front::wgsl::parse_str(text).unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)));
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}", e.emit_to_string(text)));
        let entries: BTreeSet<&str> = module.entry_points.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(entries, BTreeSet::from(STAGES));
        for (_, variable) in module.global_variables.iter() {
            if variable.binding.is_some() {
                assert!(matches!(variable.space, AddressSpace::Uniform | AddressSpace::Storage { .. }));
            }
        }
        assert!(!text.lines().any(|line| line.starts_with("enable") || line.starts_with("requires")));
    }
}

#[test]
fn an_invalid_kernel_or_one_with_a_feature_is_noticed() {
    let needs = common::all_needs()[0];
    let broken = Sources::default().replace("kernel_ellipse.wgsl", "exp(-KERNEL_A", "exp(-view").unwrap();
    assert!(reflect(&broken.join(&needs)).is_err());
    let wide =
        Sources::default().replace("kernel_ellipse.wgsl", "var power: f32;", "var power: f32; let w = 1lu;").unwrap();
    let text = wide.join(&needs);
    let module = naga::front::wgsl::parse_str(&text).unwrap();
    assert!(Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).is_err());
}

#[test]
fn every_file_is_known_and_reached() {
    let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/wgsl");
    let on_disk: BTreeSet<String> = std::fs::read_dir(directory)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".wgsl"))
        .collect();
    let known: BTreeSet<String> = FILES.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(on_disk, known);
    assert_eq!(known.len(), FILES.len());
    let reached: BTreeSet<String> = common::all_needs().iter().flat_map(files).map(str::to_owned).collect();
    assert_eq!(reached, known);
}

#[test]
fn host_and_kernels_agree_about_overrides() {
    let sources = Sources::default();
    let options = RenderOptions::default();
    let mut declared_anywhere = BTreeSet::new();
    let mut set_anywhere = BTreeSet::new();
    for needs in common::all_needs() {
        let module = reflect(&sources.join(&needs)).unwrap().0;
        let set: BTreeSet<String> = overrides(&needs, &options).into_iter().map(|(name, _)| name.to_owned()).collect();
        for (_, declared) in module.overrides.iter() {
            let name = declared.name.clone().unwrap();
            assert!(declared.id.is_none(), "{name} is set by name");
            assert!(declared.init.is_some() || set.contains(&name), "nobody sets {name}");
            declared_anywhere.insert(name);
        }
        set_anywhere.extend(set);
    }
    assert_eq!(declared_anywhere, set_anywhere);
}

#[test]
fn storage_buffers_stay_within_core_limits() {
    let sources = Sources::default();
    let mut most = 0;
    for needs in common::all_needs() {
        let (module, bindings, _) = reflect(&sources.join(&needs)).unwrap();
        let stored: BTreeSet<&str> = module
            .global_variables
            .iter()
            .filter(|(_, v)| matches!(v.space, AddressSpace::Storage { .. }))
            .filter_map(|(_, v)| v.name.as_deref())
            .collect();
        for (stage, variables) in &bindings {
            let count = variables.iter().filter(|(name, _)| stored.contains(name.as_str())).count();
            assert!(count <= CORE_STORAGE_BUFFERS, "{stage} of {:?} uses {count}", needs.names());
            most = most.max(count);
        }
    }
    assert_eq!(most, STORAGE_BUFFERS as usize, "what an adapter is asked for is what the largest kernel uses");
}

/// `fn name(parameters) -> result` of a file's functions, by name.
fn signatures(text: &str) -> BTreeMap<String, String> {
    let code: String = text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join(" ");
    let mut found = BTreeMap::new();
    for part in code.split("fn ").skip(1) {
        let signature = part.split('{').next().unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
        let signature = signature.replace("( ", "(").replace(", )", ")");
        found.insert(signature.split('(').next().unwrap().to_owned(), signature);
    }
    found
}

fn text_of(name: &str) -> &'static str {
    FILES.iter().find(|(file, _)| *file == name).unwrap_or_else(|| panic!("no {name}")).1
}

/// What is absent has the interface of what it stands for: each function of the absent file exists in its partner with
/// the same parameters and result. (That none is missing is what the validity of every combination shows.)
#[test]
fn absent_parts_have_their_partners_signatures() {
    let absent: Vec<&str> = FILES.iter().map(|(name, _)| *name).filter(|name| name.ends_with("_absent.wgsl")).collect();
    assert!(absent.len() >= 5);
    let mut pairs: Vec<(&str, Vec<String>)> =
        absent.into_iter().map(|name| (name, vec![name.replace("_absent", "")])).collect();
    pairs.push(("color_constant.wgsl", vec!["color_srgb8.wgsl".into(), "color_sums.wgsl".into()]));
    pairs.push(("color_constant.wgsl", vec!["color_linear.wgsl".into(), "color_sums.wgsl".into()]));
    pairs.push(("shade_unlit.wgsl", vec!["shade_lambert.wgsl".into()]));
    for (name, partners) in pairs {
        let partner: BTreeMap<_, _> = partners.iter().flat_map(|partner| signatures(text_of(partner))).collect();
        let own = signatures(text_of(name));
        assert!(!own.is_empty(), "{name}");
        for (function, signature) in own {
            assert_eq!(partner.get(&function), Some(&signature), "{name} and {partners:?}");
        }
    }
    let shared = ["homography", "intersect", "ray"];
    let (pinhole, orthographic) =
        (signatures(text_of("camera_pinhole.wgsl")), signatures(text_of("camera_orthographic.wgsl")));
    for function in shared {
        assert!(pinhole.contains_key(function));
        assert_eq!(pinhole.get(function), orthographic.get(function));
    }
}
