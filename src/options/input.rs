//! How input files are read.

use crate::io::dimensions::ClassList;
use crate::io::{self, ClassOpacities, Filter, Format, Wanted};

/// The format of input files, and attributes to ignore.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Input"))]
// Brackets in help texts hold defaults, not links.
#[allow(rustdoc::broken_intra_doc_links)]
pub struct FormatOptions {
    /// Format of the inputs [default: from their names, or else their first bytes]
    #[cfg_attr(feature = "cli", arg(long, value_name = "FORMAT", value_parser = formats(), hide_short_help = true))]
    pub input_format: Option<Format>,
    /// Ignore the alphas of colours, where some programs store other values
    ///
    /// The opacities of Gaussians are still used
    #[cfg_attr(feature = "cli", arg(long, hide_short_help = true))]
    pub ignore_alpha: bool,
}

/// How point clouds are read.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[cfg_attr(feature = "cli", command(next_help_heading = "Input"))]
// Brackets in help texts hold ranges, not links.
#[allow(rustdoc::broken_intra_doc_links)]
pub struct InputOptions {
    /// The format of the files, and attributes to ignore.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub file: FormatOptions,
    /// Keep points that a LAS file marks as withheld (deleted), which are left out by default
    #[cfg_attr(feature = "cli", arg(long, hide_short_help = true))]
    pub keep_withheld: bool,
    /// Opacities of LAS classes: CLASS:A or FIRST-LAST:A, such as 3-5:0.3,7:0
    ///
    /// The example makes vegetation (3 to 5) transparent and leaves out noise (7). Points of
    /// opacity 0 are left out and counted. Other opacities show with render --composite
    #[cfg_attr(feature = "cli", arg(long, value_name = "RULES", hide_short_help = true))]
    pub class_opacity: Option<ClassOpacities>,
    /// Take only the points of these LAS classes: names or numbers, such as ground,building or 3-5
    ///
    /// Names are those of the LAS specification (--color-by class --legend shows them), vegetation
    /// for 3 to 5, and others for classes without a name
    #[cfg_attr(feature = "cli", arg(long, value_name = "CLASSES"))]
    pub classes: Option<ClassList>,
    /// Take only points whose attributes lie in ranges, such as Classification[2:2],Z[:120]
    ///
    /// The notation is that of PDAL's filters.range: [ and ] include an end, ( and ) exclude it, an
    /// end may be missing, and ! before the brackets takes the points outside. Points have to pass
    /// one of the ranges of each attribute. `epsplat info` lists the attributes and their ranges;
    /// the names of --color-by are understood too
    #[cfg_attr(feature = "cli", arg(long = "where", value_name = "RANGES", allow_hyphen_values = true))]
    pub filter: Option<Filter>,
    /// Draw the Gaussians of a 3DGS file as surfels, without their shortest axis
    #[cfg_attr(feature = "cli", arg(long, hide_short_help = true))]
    pub flatten: bool,
    /// Fail if a part of an input cannot be read; by default the rest is drawn
    ///
    /// A part is a file of a folder, a scan of an E57 file, a chunk of a LAZ file or a node of a
    /// COPC file. A note names the parts that are left out
    #[cfg_attr(feature = "cli", arg(long, hide_short_help = true))]
    pub strict: bool,
}

/// Parses the names of the formats that this build reads.
#[cfg(feature = "cli")]
fn formats() -> impl clap::builder::TypedValueParser<Value = Format> {
    use clap::builder::{PossibleValuesParser, TypedValueParser};
    let names = Format::READ.iter().map(|(name, _)| *name);
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Format>())
}

impl InputOptions {
    /// Returns the options for reading a single file.
    pub(crate) fn of_file(&self) -> io::ReadOptions {
        io::ReadOptions {
            format: self.file.input_format,
            keep_withheld: self.keep_withheld,
            flatten: self.flatten,
            solid: false,
            classes: self.class_opacity.unwrap_or_default(),
            ignore_alpha: self.file.ignore_alpha,
            describe: false,
            strict: self.strict,
            wanted: Wanted { filter: self.filter(), ..Wanted::default() },
        }
    }

    /// Returns the options for reading a single file with the attribute `column`.
    pub(crate) fn with_column(&self, column: Option<String>) -> io::ReadOptions {
        let options = self.of_file();
        io::ReadOptions { wanted: Wanted { column, ..options.wanted }, ..options }
    }

    /// Returns the conditions of `--where` and `--classes` together.
    pub(crate) fn filter(&self) -> Filter {
        self.filter.clone().unwrap_or_default().with_classes(self.classes)
    }

    /// Formats these options as arguments of a command that reads the same file, each preceded by a
    /// space.
    pub fn arguments(&self) -> String {
        let format = self.file.input_format;
        let format = format.and_then(|format| Format::READ.iter().find(|(_, known)| *known == format));
        let format = format.map_or(String::new(), |(name, _)| format!(" --input-format {name}"));
        let withheld = if self.keep_withheld { " --keep-withheld" } else { "" };
        let classes = self.class_opacity.filter(|opacities| !opacities.are_plain());
        let classes = classes.map_or(String::new(), |opacities| format!(" --class-opacity {opacities}"));
        let alpha = if self.file.ignore_alpha { " --ignore-alpha" } else { "" };
        let kept = self.classes.map_or(String::new(), |classes| format!(" --classes {classes}"));
        let filter = self.filter.as_ref().map_or(String::new(), |filter| format!(" --where '{filter}'"));
        let classes = classes + &kept + &filter;
        let strict = if self.strict { " --strict" } else { "" };
        format + withheld + if self.flatten { " --flatten" } else { "" } + alpha + &classes + strict
    }
}
