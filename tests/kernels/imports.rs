//! The import lines at the heads of WGSL files: each names exactly the functions, types and
//! constants that the file uses from another file, and the file that defines them.
//!
//! The tables of passes decide which files are joined into a module, so an import has no effect: it
//! tells a reader where a name is defined. `EPSPLAT_WRITE_IMPORTS=1` rewrites all import lines.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use epsplat::low_level::gpu::sources::FILES;

/// The start of an import line.
const IMPORT: &str = "// #import ";

/// Columns of the longest import line.
const COLUMNS: usize = 100;

/// Words that declare the name that follows them.
const DECLARATIONS: [&str; 7] = ["fn", "struct", "const", "override", "alias", "var", "let"];

/// The names of a file: those that it defines at module scope, and those that it uses without
/// defining them.
struct Names {
    defined: BTreeSet<String>,
    used: BTreeSet<String>,
}

/// The words and signs of a text without its comments.
fn tokens(text: &str) -> Vec<String> {
    let mut tokens = Vec::new();
    for line in text.lines() {
        let code = line.split("//").next().unwrap();
        let mut word = String::new();
        for sign in code.chars().chain([' ']) {
            if sign.is_alphanumeric() || sign == '_' {
                word.push(sign);
                continue;
            }
            tokens.extend((!word.is_empty()).then(|| std::mem::take(&mut word)));
            tokens.extend((!sign.is_whitespace()).then(|| sign.to_string()));
        }
    }
    tokens
}

fn names(text: &str) -> Names {
    let tokens = tokens(text);
    let (mut defined, mut own, mut used) = (BTreeSet::new(), BTreeSet::new(), BTreeSet::new());
    let mut depth = 0;
    for (k, token) in tokens.iter().enumerate() {
        match token.as_str() {
            "{" => depth += 1,
            "}" => depth -= 1,
            _ => {}
        }
        if !token.starts_with(|first: char| first.is_alphabetic() || first == '_') {
            continue;
        }
        let before = |steps: usize| k.checked_sub(steps).map_or("", |at| tokens[at].as_str());
        // `var<storage, read> name` declares after its address space.
        let spaces = ["storage", "read", "read_write", "workgroup", "private", "uniform", ","];
        let opened = tokens[..k.max(1) - 1].iter().rposition(|token| !spaces.contains(&token.as_str()));
        let after_space =
            before(1) == ">" && opened.is_some_and(|at| at > 0 && tokens[at] == "<" && tokens[at - 1] == "var");
        if DECLARATIONS.contains(&before(1)) || after_space {
            own.insert(token.clone());
            defined.extend((depth == 0).then(|| token.clone()));
        } else if tokens.get(k + 1).is_some_and(|next| next == ":") {
            // A parameter or a field.
            own.insert(token.clone());
        } else if before(1) != "." {
            used.insert(token.clone());
        }
    }
    Names { defined, used: used.difference(&own).cloned().collect() }
}

/// Returns how an import names the files that define something: one file (also for a pair with its
/// `_absent` counterpart), a family by its prefix, up to three files, or any (`*`).
fn provider(files: &BTreeSet<&str>) -> String {
    let all: Vec<&str> = files.iter().copied().collect();
    match all[..] {
        [one] => return one.to_owned(),
        [one, other] if other == format!("{one}_absent") => return one.to_owned(),
        _ => {}
    }
    let family = |file: &str| file.rfind('_').map(|end| file[..=end].to_owned());
    let mut prefix = family(all[0]);
    while let Some(start) = &prefix {
        if all.iter().all(|file| file.starts_with(start.as_str())) {
            return format!("{start}*");
        }
        prefix = family(start.trim_end_matches('_'));
    }
    if all.len() <= 3 { all.join("|") } else { "*".to_owned() }
}

/// The import lines of each file, by its name.
fn imports(files: &BTreeMap<String, String>) -> BTreeMap<String, Vec<String>> {
    let names: BTreeMap<&str, Names> = files.iter().map(|(file, text)| (file.as_str(), names(text))).collect();
    let mut definers: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for (file, names) in &names {
        names.defined.iter().for_each(|name| {
            definers.entry(name).or_default().insert(file.trim_end_matches(".wgsl"));
        });
    }
    let of = |names: &Names| {
        let mut by_provider: BTreeMap<String, Vec<&str>> = BTreeMap::new();
        for name in &names.used {
            if let Some(files) = definers.get(name.as_str()) {
                by_provider.entry(provider(files)).or_default().push(name);
            }
        }
        by_provider.iter().flat_map(|(provider, names)| lines(provider, names)).collect()
    };
    names.iter().map(|(file, names)| ((*file).to_owned(), of(names))).collect()
}

/// Formats one import, in lines of at most [`COLUMNS`].
fn lines(provider: &str, names: &[&str]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for name in names {
        match lines.last_mut() {
            Some(line) if line.len() + name.len() + 2 < COLUMNS => *line += &format!(", {name}"),
            _ => lines.push(format!("{IMPORT}{provider}::{{{name}")),
        }
    }
    lines.iter().map(|line| format!("{line}}}")).collect()
}

fn built_in() -> BTreeMap<String, String> {
    FILES.iter().map(|(file, text)| ((*file).to_owned(), (*text).to_owned())).collect()
}

fn declared(text: &str) -> Vec<String> {
    text.lines().filter(|line| line.starts_with(IMPORT)).map(str::to_owned).collect()
}

/// A file's text with the lines `imports` below its first comment.
fn with_imports(text: &str, imports: &[String]) -> String {
    let plain: Vec<&str> = text.lines().filter(|line| !line.starts_with(IMPORT)).collect();
    let head = plain.iter().take_while(|line| line.starts_with("//")).count();
    let below: Vec<&str> = plain[head..].iter().skip_while(|line| line.is_empty()).copied().collect();
    let imports = imports.iter().map(String::as_str);
    let lines = plain[..head].iter().copied().chain(imports).chain([""]).chain(below);
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

fn path_of(file: &str) -> PathBuf {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/wgsl"));
    let stages = std::fs::read_dir(folder).unwrap();
    stages.map(|stage| stage.unwrap().path().join(file)).find(|path| path.exists()).unwrap()
}

#[test]
fn each_file_imports_what_it_uses_and_nothing_else() {
    let files = built_in();
    let expected = imports(&files);
    if std::env::var("EPSPLAT_WRITE_IMPORTS").is_ok_and(|value| value == "1") {
        for (file, text) in &files {
            std::fs::write(path_of(file), with_imports(text, &expected[file])).unwrap();
        }
        return;
    }
    for (file, text) in &files {
        assert_eq!(declared(text), expected[file], "{file}: EPSPLAT_WRITE_IMPORTS=1 writes the imports anew");
    }
    // Control: a use that is not declared, and a declaration that nothing uses, are found.
    let changed = |from: &str, to: &str| {
        let mut files = built_in();
        let text = files.get_mut("blend.wgsl").unwrap();
        assert!(text.contains(from));
        *text = text.replace(from, to);
        declared(&files["blend.wgsl"]) == imports(&files)["blend.wgsl"]
    };
    assert!(changed("fragment_weight(", "fragment_weight("));
    assert!(!changed("kernel_weight(fragment.rho2)", "fragment.rho2"));
    assert!(!changed("fragment.gain * unfiltered", "fragment.gain * unfiltered * pixel_index(0u, 0u)"));
}

#[test]
fn names_are_those_of_code() {
    let names = names(
        "// comment(name)\noverride SIZE: u32;\n@group(0) @binding(1) var<storage, read> held: Held;\n\
         fn sum(of_: u32) -> Term { let each = term(of_ * SIZE); return each.field + held.other; }",
    );
    assert_eq!(names.defined.iter().map(String::as_str).collect::<Vec<_>>(), ["SIZE", "held", "sum"]);
    for (name, used) in [("term", true), ("Held", true), ("Term", true), ("field", false), ("each", false)] {
        assert_eq!(names.used.contains(name), used, "{name}");
    }
    assert!(!names.used.contains("comment") && !names.used.contains("SIZE"));
}

#[test]
fn providers_are_files_families_or_any() {
    let of = |files: &[&str]| provider(&files.iter().copied().collect());
    assert_eq!(of(&["layout"]), "layout");
    assert_eq!(of(&["clip", "clip_absent"]), "clip");
    assert_eq!(of(&["camera_orthographic", "camera_pinhole"]), "camera_*");
    assert_eq!(of(&["normal_own", "normal_plane"]), "normal_*");
    assert_eq!(of(&["filter", "lowpass_none"]), "filter|lowpass_none");
    assert_eq!(of(&["a", "b_1", "c", "d"]), "*");
}
