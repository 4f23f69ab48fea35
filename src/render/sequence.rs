//! Makes the list of steps of a frame: the passes of the papers in their order.

use std::ops::Range;

use crate::passes::{
    accumulate, cull, fragments, individuals, long_lists, of_maps, oit, peel, project, raster, resolve, tiles,
    triangles, veils, visibility,
};
use crate::plan::known::Listed;
use crate::plan::steps::{Exchanged, Look, Part, Reduced, Stage, Step, Twin};
use crate::plan::{Oit, Plan, Rasterised, Surface, Winner};

/// Returns the steps of a frame by `plan`.
pub fn steps(plan: &Plan) -> Vec<Step> {
    let mut steps = Vec::new();
    if plan.needs.levels {
        steps.push(Step::Select);
    }
    if plan.looks_for_cut() {
        // Buffers for the rest are sized once the cut is known.
        steps.push(Step::Look(Look::Cut));
        return steps;
    }
    if let Surface::Raster { shown, .. } = plan.needs.surface {
        steps.push(Step::Stage(project::steps(plan, 0, Part::All)));
        steps.extend(plan.needs.mesh.into_iter().flat_map(|_| triangles::drawn()));
        match shown {
            Rasterised::Layers(layers) => steps.extend(peel::steps(plan, layers)),
            Rasterised::Blended | Rasterised::Nearest => steps.push(raster::STEP),
        }
    }
    for band in 0..plan.bands.len() {
        if plan.needs.mesh.is_some() {
            steps.extend(triangles::steps(plan, band).into_iter().map(Step::Stage));
            steps.extend(exchange(plan, Exchanged::Triangles, band));
        }
        match plan.needs.surface {
            Surface::Raster { .. } => {}
            Surface::Layers { .. } | Surface::Sorted { .. } => lists(plan, band, &mut steps),
            Surface::OrderFree(_) => order_free(plan, band, &mut steps),
            Surface::Blended { .. } | Surface::Nearest(_) => {
                project_in(plan, band, &mut steps);
                for pages in plan.together() {
                    nearest(plan, band, &pages, &mut steps);
                    sums(plan, band, &pages, &mut steps);
                }
            }
        }
        if !plan.needs.surface.gathers() || plan.needs.surface.separate() {
            steps.push(Step::Stage(resolve::steps(plan, band)));
        }
        steps.extend(of_maps(plan, band).map(Step::Stage));
        steps.push(Step::ReadBack(band));
    }
    steps
}

/// Projects the splats, once for all bands or for each band. With culling, [`nearest`] projects
/// them part by part.
fn project_in(plan: &Plan, band: usize, steps: &mut Vec<Step>) {
    if !plan.needs.cull && plan.projects_in(band) {
        steps.push(Step::Stage(project::steps(plan, band, Part::All)));
    }
}

/// Appends the steps that find the nearest depth of each pixel of a band.
fn nearest(plan: &Plan, band: usize, pages: &Range<usize>, steps: &mut Vec<Step>) {
    for &part in plan.parts() {
        if plan.needs.cull && plan.projects_in(band) {
            steps.push(Step::Stage(cull::steps(band, part)));
            steps.extend(plan.looks_for_slots.then_some(Step::Look(Look::Slots(part))));
            steps.push(Step::Stage(project::steps(plan, band, part)));
        }
        let drawn = visibility::steps(plan, band, part).into_iter();
        steps.extend(drawn.flat_map(|stage| on(plan, pages, stage)).map(Step::Stage));
        if part == Part::Near {
            steps.push(Step::Stage(visibility::occlude(band, part)));
        }
    }
    if plan.looks_for_lists[Listed::Large as usize] && plan.projects_in(band) {
        steps.push(tiles::look(plan, Listed::Large, band, pages.clone()));
    }
    let by_workgroups = on(plan, pages, visibility::large(band)).collect();
    large(plan, (tiles::visibility(plan, band, pages.clone()), by_workgroups), steps);
    let found = match plan.needs.surface {
        Surface::Nearest(Winner::Once) => Reduced::Winners,
        _ => Reduced::Nearest,
    };
    steps.extend(exchange(plan, Exchanged::Numbers(found), band));
    steps.push(Step::Stage(visibility::occlude(band, Part::All)));
}

/// The step at which processes that draw a frame together exchange values of a band. Values in
/// registers cannot be exchanged, and of triangles only those beside one surface per pixel.
fn exchange(plan: &Plan, what: Exchanged, band: usize) -> Option<Step> {
    let surface = plan.needs.surface;
    let is_kept = !surface.gathers() && !surface.separate();
    let is_needed = what != Exchanged::Triangles || matches!(surface, Surface::Blended { .. });
    (is_kept && is_needed).then_some(Step::Exchange(what, band))
}

/// Returns the stage over all pages or, if inputs are separate, one copy of the stage per page of
/// `pages`. Only the first copy has the clears. The copies have no twin, because the reference
/// draws a separate input in one step ([`Twin::Individual`]).
fn on(plan: &Plan, pages: &Range<usize>, stage: Stage) -> impl Iterator<Item = Stage> {
    let each = if plan.needs.surface.separate() { pages.clone() } else { 0..0 };
    let whole = (!plan.needs.surface.separate()).then(|| stage.clone());
    let first = pages.start;
    let of_page = move |page: usize| {
        let stage = stage.clone().without_twin().of_page(page);
        if page == first { stage } else { stage.after(Vec::new()) }
    };
    whole.into_iter().chain(each.map(of_page))
}

/// Appends the steps that list the fragments of each pixel of a band, sorted from front to back.
fn lists(plan: &Plan, band: usize, steps: &mut Vec<Step>) {
    if plan.projects_in(band) {
        steps.push(Step::Stage(project::steps(plan, band, Part::All)));
    }
    let small = visibility::steps(plan, band, Part::All).map(Stage::without_twin);
    let count = small.into_iter().chain([visibility::large(band)]).chain(veils::steps(plan, band));
    steps.extend(count.map(Step::Stage));
    steps.extend(exchange(plan, Exchanged::Numbers(Reduced::Counts), band));
    steps.push(Step::Stage(visibility::occlude(band, Part::All)));
    steps.extend(fragments::starts(band));
    let [list, sort] = fragments::steps(band);
    steps.push(Step::Stage(list));
    steps.extend(exchange(plan, Exchanged::Fragments, band));
    steps.extend([sort].into_iter().chain(long_lists::sorts(plan, band)).map(Step::Stage));
}

/// Appends the steps that sum all fragments of each pixel of a band, in any order.
fn order_free(plan: &Plan, band: usize, steps: &mut Vec<Step>) {
    if plan.projects_in(band) {
        steps.push(Step::Stage(project::steps(plan, band, Part::All)));
    }
    let small = visibility::steps(plan, band, Part::All).map(Stage::without_twin);
    let of_all = small.into_iter().chain([visibility::large(band)]);
    if plan.needs.surface.oit() == Some(Oit::Moments) {
        steps.extend(of_all.map(Step::Stage));
        let found = [Reduced::Nearest, Reduced::Common("moments")].map(Exchanged::Numbers);
        steps.extend(found.into_iter().filter_map(|found| exchange(plan, found, band)));
    }
    let sums = [accumulate::steps(plan, band, true).as_twin(Twin::Oit), accumulate::large(band)];
    steps.extend(sums.map(Step::Stage));
    steps.extend(exchange(plan, Exchanged::Numbers(Reduced::Sums), band));
    let covered = oit::marks(&plan.needs).then(|| oit::mark(plan, band)).into_iter();
    steps.extend(covered.chain([visibility::occlude(band, Part::All)]).map(Step::Stage));
}

/// Appends the steps that sum the fragments of each pixel of a band. With separate inputs the steps
/// also keep the nearest surface so far. Tiles that gather also make the image.
fn sums(plan: &Plan, band: usize, pages: &Range<usize>, steps: &mut Vec<Step>) {
    // The visibility pass has already found the colours.
    if matches!(plan.needs.surface, Surface::Nearest(Winner::Depth | Winner::Once)) {
        return;
    }
    let looks = plan.looks_for_lists[Listed::Small as usize];
    if plan.needs.surface.gathers() {
        steps.extend(looks.then(|| tiles::look(plan, Listed::Small, band, pages.clone())));
        steps.extend(tiles::resolve(plan, band, pages.start).into_iter().map(Step::Stage));
    } else {
        let first = pages.start == 0;
        steps.extend(on(plan, pages, accumulate::steps(plan, band, first)).map(Step::Stage));
        let by_workgroups = on(plan, pages, accumulate::large(band)).collect();
        large(plan, (tiles::accumulate(plan, band, pages.clone()), by_workgroups), steps);
        let summed = match plan.needs.surface {
            Surface::Nearest(_) => Reduced::Winners,
            _ => Reduced::Sums,
        };
        steps.extend(exchange(plan, Exchanged::Numbers(summed), band));
        if plan.needs.surface.separate() {
            steps.push(Step::Stage(individuals::keep(plan, band, first)));
        }
    }
    if let (true, Some(Step::Stage(last))) = (plan.needs.surface.separate(), steps.last_mut()) {
        last.twin = plan.individuals.iter().position(|own| own == pages).map(Twin::Individual);
    }
}

/// Appends the stages of the large splats, by tiles or by workgroups. If the plan does not know
/// which, it includes both, and the executor decides by counts read from the device.
fn large(plan: &Plan, (by_tiles, by_workgroups): (Vec<Stage>, Vec<Stage>), steps: &mut Vec<Step>) {
    // Tiles that gather either have lists, or the frame is retried without gathering.
    let looks = plan.looks_for_lists[Listed::Large as usize] && !plan.needs.surface.gathers();
    match plan.large_by_tiles {
        true if looks => steps.push(Step::Large { by_tiles, by_workgroups }),
        true => steps.extend(by_tiles.into_iter().map(Step::Stage)),
        false => steps.extend(by_workgroups.into_iter().map(Step::Stage)),
    }
}
