//! The files of every module: the layout that host and device share, reading of records, and surfel
//! centres.

use crate::plan::pass::Pass;

/// The pass's files and constants.
pub const PASS: Pass = Pass {
    name: "shared",
    files: |needs| {
        let pick = |needed, file, absent| if needed { file } else { absent };
        let mut files = vec![
            "layout.wgsl",
            "vectors.wgsl",
            pick(needs.long_words, "words_long.wgsl", "words.wgsl"),
            "records.wgsl",
            pick(needs.clips, "clip.wgsl", "clip_absent.wgsl"),
            pick(needs.outline, "outline.wgsl", "outline_absent.wgsl"),
            pick(needs.facing.is_some(), "facing.wgsl", pick(needs.curved, "curved.wgsl", "flat.wgsl")),
            "double.wgsl",
            "rows.wgsl",
            pick(needs.doubled, "center_doubled.wgsl", "center.wgsl"),
            pick(needs.surface.copies(), "copies.wgsl", "copies_absent.wgsl"),
            pick(needs.fades, "fade.wgsl", "fade_absent.wgsl"),
        ];
        let frame = pick(needs.lens.is_some(), "frame_lens.wgsl", "frame_plain.wgsl");
        files.extend((needs.facing.is_none() && needs.curved).then_some(frame));
        // With a cut, select_fades.wgsl reads the fades that the cut assigns.
        files.extend((needs.fades && !needs.levels).then_some("fade_own.wgsl"));
        files
    },
    kernels: |_| Vec::new(),
    constants: |making| {
        making.options.outline.map_or_else(Vec::new, |outline| {
            let (sin, cos) = outline.half_angle().sin_cos();
            let above = outline.sides().div_ceil(2);
            vec![("OUTLINE_SIDES", above.into()), ("OUTLINE_COS", cos), ("OUTLINE_SIN", sin)]
        })
    },
};
