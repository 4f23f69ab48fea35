//! The page for people: one file that needs no network and no script. It is well-formed XML too, so
//! that a test can parse it.

use super::case::cases;
use super::family::Families;
use super::heatmap::{Map, Scale};
use super::picture;
use super::results::{ImageSet, Study};
use super::text::{count, escape, significant};
use super::{choice, pareto, scaling, tables};
use crate::Result;

/// Contains no `<` and no `&`, so it needs no escaping in XML.
const STYLE: &str = include_str!("style.css");

/// Returns the whole page.
pub(super) fn page(study: &Study) -> Result<String> {
    let families = Families::of(&study.measurements);
    let cases = cases(&study.measurements);
    let sections = [
        header(study),
        choice::section(&cases),
        pareto::section(&cases, &families),
        tables::section(&study.measurements, &families),
        scaling::section(&study.measurements, &families),
        images(&study.images)?,
        "<section><h2>Files</h2><p>All numbers of this page: <a href=\"results.csv\">results.csv</a>, \
         <a href=\"results.json\">results.json</a>.</p></section>"
            .to_owned(),
    ];
    let (name, sections) = (escape(&study.name), sections.join("\n"));
    Ok(format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/><link rel=\"icon\" href=\"data:,\"/>\
         <title>{name}</title><style>\n{STYLE}</style></head>\n<body>\n{sections}\n</body></html>\n"
    ))
}

/// Describes the study and the machine that it ran on.
fn header(study: &Study) -> String {
    let machine = &study.machine;
    let rows = [
        ("adapter", machine.adapter.clone()),
        ("driver", [&machine.api, &machine.driver].map(String::as_str).join(", ")),
        ("processor", format!("{}, {} cores", machine.cpu, machine.cores)),
        ("system", machine.os.clone()),
        ("epsplat", [&machine.version, &machine.commit].map(String::as_str).join(" ")),
        ("date", study.date.clone()),
        ("runs", format!("{} of each configuration", count(study.runs.into()))),
    ];
    let rows: String = rows.iter().map(|(term, value)| format!("<dt>{term}</dt><dd>{}</dd>", escape(value))).collect();
    let (name, about, command) = (escape(&study.name), escape(&study.about), escape(&study.command));
    format!(
        "<header><h1>{name}</h1><p class=\"about\">{about}</p><dl>{rows}</dl><pre><code>{command}</code></pre></header>"
    )
}

/// Shows the pictures of each scene. All heat maps have the same scale, so that they can be
/// compared.
fn images(sets: &[ImageSet]) -> Result<String> {
    if sets.is_empty() {
        return Ok(String::new());
    }
    let side = picture::largest_side(sets.len());
    let compare = |set: &ImageSet| set.reference.as_ref().map(|truth| Map::of(&set.image, truth, side)).transpose();
    let maps: Vec<Option<Map>> = sets.iter().map(compare).collect::<Result<_>>()?;
    let scale = Scale::over(maps.iter().flatten().flat_map(|map| map.shown.values.iter().copied()));
    let mut scenes: Vec<(&str, String)> = Vec::new();
    for (set, map) in sets.iter().zip(&maps) {
        let figure = figure(set, map.as_ref(), scale, side)?;
        match scenes.iter_mut().find(|(scene, _)| *scene == set.scene) {
            Some((_, figures)) => figures.push_str(&figure),
            None => scenes.push((&set.scene, figure)),
        }
    }
    let legend = if maps.iter().any(Option::is_some) { scale.legend() } else { String::new() };
    let scenes: String = scenes
        .iter()
        .map(|(scene, figures)| format!("<h3>{}</h3>{legend}<div class=\"pictures\">{figures}</div>", escape(scene)))
        .collect();
    Ok(format!(
        "<section><h2>Images</h2><p>Left is the image, right its difference from the f64 reference: the largest \
         of a pixel's linear RGBA values. Black is no difference.</p>{scenes}</section>"
    ))
}

fn figure(set: &ImageSet, map: Option<&Map>, scale: Scale, side: u32) -> Result<String> {
    let what = format!("{} by {}", set.scene, set.config);
    let image = picture::of_frame(&set.image, side, &what)?;
    let (heat, said) = match map {
        None => (String::new(), "not compared".to_owned()),
        Some(map) => {
            let said = if map.share == 0.0 {
                "equal to the reference".to_owned()
            } else {
                let (largest, share) = (significant(map.largest, 2), significant(100.0 * map.share, 2));
                format!("largest difference {largest}, {share} % of the pixels differ")
            };
            (map.picture(scale, &format!("Difference of {what} from its reference: {said}"))?, said)
        }
    };
    let factor = picture::shrink_factor(set.image.width, set.image.height, side);
    let shrunk = match factor {
        1 => String::new(),
        _ => format!(
            " Shown at 1/{factor} of its size; the difference is the largest of each {factor} × {factor} pixels."
        ),
    };
    let class = if map.is_some() { "pair" } else { "pair alone" };
    let config = escape(&set.config);
    Ok(format!(
        "<figure><div class=\"{class}\">{image}{heat}</div><figcaption><strong>{config}</strong>: {said}.{shrunk}\
         </figcaption></figure>"
    ))
}
