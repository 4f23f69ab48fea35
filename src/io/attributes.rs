//! Names of point attributes that programs write in PLY and PCD files.
//!
//! These programs write the names, or recognise them when reading: PDAL (`normalx`, `intensity`,
//! `red` of 16 bits), CloudCompare (`scalar_` before the name of a scalar field, `Rf` for the red
//! of colours that are fractions), ParaView (`Normals:0`, `RGB_0`), the Point Cloud
//! Library (`normal_x`, `rgb`, `rgba`, `intensity`), Open3D (`normal_x` and `rgb` in PCD), MeshLab
//! (`nx`, `red`, `quality`, `radius`, `texture_u`), Blender (`s`, `t`), Houdini (`Cd`, `N`,
//! `pscale`), Stanford's scans (`diffuse_red`, `confidence`, `intensity`) and 3D Gaussian splatting
//! (`nxx ny nz`). CGAL, Agisoft and Metashape use some of the same names.
//!
//! Case does not matter, but a name of the same case takes precedence. A prefix `scalar_` is
//! ignored.

/// Names of the red, green and blue channel.
pub(super) const COLOR: [&[&str]; 3] = [
    &[
        "red",
        "r",
        "diffuse_red",
        "rgb_r",
        "color_r",
        "colour_r",
        "color_red",
        "colour_red",
        "vertex_red",
        "rgb[0]",
        "Cd_r",
        "Cd_x",
        "Cdr",
        "Cd[0]",
        "Cd.r",
        "Cd.x",
        "Cd0",
        "Cd_0",
        "col_r",
        "col.r",
        "ambient_red",
        "Rf",
        "RGB:0",
        "RGB_0",
    ],
    &[
        "green",
        "g",
        "diffuse_green",
        "rgb_g",
        "color_g",
        "colour_g",
        "color_green",
        "colour_green",
        "vertex_green",
        "rgb[1]",
        "Cd_g",
        "Cd_y",
        "Cdg",
        "Cd[1]",
        "Cd.g",
        "Cd.y",
        "Cd1",
        "Cd_1",
        "col_g",
        "col.g",
        "ambient_green",
        "Gf",
        "RGB:1",
        "RGB_1",
    ],
    &[
        "blue",
        "b",
        "diffuse_blue",
        "rgb_b",
        "color_b",
        "colour_b",
        "color_blue",
        "colour_blue",
        "vertex_blue",
        "rgb[2]",
        "Cd_b",
        "Cd_z",
        "Cdb",
        "Cd[2]",
        "Cd.b",
        "Cd.z",
        "Cd2",
        "Cd_2",
        "col_b",
        "col.b",
        "ambient_blue",
        "Bf",
        "RGB:2",
        "RGB_2",
    ],
];

/// Names of the opacity beside a colour.
pub(super) const ALPHA: &[&str] =
    &["alpha", "a", "diffuse_alpha", "color_alpha", "color_a", "rgba_a", "col_a", "vertex_alpha", "Af"];

/// Names of the components of a normal.
pub(super) const NORMAL: [&[&str]; 3] = [
    &[
        "nx",
        "normal_x",
        "normalx",
        "nxx",
        "n_x",
        "norm_x",
        "normals_x",
        "normal.x",
        "normal[0]",
        "nor_x",
        "N_x",
        "N.x",
        "N[0]",
        "Nx",
        "Normals:0",
        "Normals_0",
    ],
    &[
        "ny",
        "normal_y",
        "normaly",
        "nyy",
        "n_y",
        "norm_y",
        "normals_y",
        "normal.y",
        "normal[1]",
        "nor_y",
        "N_y",
        "N.y",
        "N[1]",
        "Ny",
        "Normals:1",
        "Normals_1",
    ],
    &[
        "nz",
        "normal_z",
        "normalz",
        "nzz",
        "n_z",
        "norm_z",
        "normals_z",
        "normal.z",
        "normal[2]",
        "nor_z",
        "N_z",
        "N.z",
        "N[2]",
        "Nz",
        "Normals:2",
        "Normals_2",
    ],
];

/// Names of the strength of the laser's echo.
pub(super) const INTENSITY: &[&str] = &[
    "intensity",
    "scalar_Intensity",
    "intensities",
    "reflectance",
    "reflectivity",
    "amplitude",
    "remission",
    "gray",
    "grey",
];

/// Names of a disk's radius in world units.
pub(super) const RADIUS: &[&str] = &["radius", "scale", "pscale"];

/// Names of normals, and of colours, that are one attribute of three or more numbers.
#[cfg(feature = "pcd")]
pub(super) const NORMAL_VECTOR: &[&str] = &["normal", "normals", "N"];
#[cfg(feature = "pcd")]
pub(super) const COLOR_VECTOR: &[&str] = &["rgb", "rgba", "color", "colors", "colour", "Cd", "Col"];

/// The index in `given` of the first of `names` that occurs there. Names of the same case take
/// precedence, then names of another case, then names after the prefix `scalar_`.
pub(super) fn find<'a>(names: &[&str], given: impl Iterator<Item = &'a str> + Clone) -> Option<usize> {
    let first =
        |is: &dyn Fn(&str, &str) -> bool| names.iter().find_map(|name| given.clone().position(|given| is(given, name)));
    let plain = |given: &str| -> Option<String> {
        let start = given.get(..7).filter(|start| start.eq_ignore_ascii_case("scalar_"))?;
        Some(given[start.len()..].to_owned())
    };
    first(&|given, name| given == name)
        .or_else(|| first(&|given, name| given.eq_ignore_ascii_case(name)))
        .or_else(|| first(&|given, name| plain(given).is_some_and(|plain| plain.eq_ignore_ascii_case(name))))
}

/// The indices of three attributes, one from each list of names.
pub(super) fn find_triple<'a>(names: [&[&str]; 3], given: impl Iterator<Item = &'a str> + Clone) -> Option<[usize; 3]> {
    // Three names of one spelling take precedence: a file with `nx ny nz` may also have a
    // `normal_x` that means something else.
    let spelling = |k: usize| [0, 1, 2].map(|channel| names[channel].get(k).copied().unwrap_or_default());
    let alike = (0..names[0].len()).find_map(|k| find_spelling(spelling(k), given.clone()));
    alike.or_else(|| {
        let one = |channel: usize| find(names[channel], given.clone());
        Some([one(0)?, one(1)?, one(2)?])
    })
}

/// The indices of three attributes with these names. Names of one case take precedence, which is
/// that of `names`, capitals or small letters.
pub(super) fn find_spelling<'a>(names: [&str; 3], given: impl Iterator<Item = &'a str> + Clone) -> Option<[usize; 3]> {
    let one = |name: String| given.clone().position(|given| given == name);
    let of_case = |case: fn(&str) -> String| {
        let [a, b, c] = names.map(|name| one(case(name)));
        Some([a?, b?, c?])
    };
    let any = |name: &str| find(&[name], given.clone());
    let cases: [fn(&str) -> String; 3] = [str::to_owned, str::to_ascii_uppercase, str::to_ascii_lowercase];
    cases.into_iter().find_map(of_case).or_else(|| Some([any(names[0])?, any(names[1])?, any(names[2])?]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_as_programs_write_them() {
        let triple = |names, given: &[&str]| find_triple(names, given.iter().copied());
        for given in [
            ["x", "red", "green", "blue"],
            ["X", "Red", "Green", "Blue"],
            ["x", "r", "g", "b"],
            ["x", "diffuse_red", "diffuse_green", "diffuse_blue"],
            ["x", "Cd_r", "Cd_g", "Cd_b"],
            ["x", "scalar_R", "scalar_G", "scalar_B"],
            ["x", "scalar_Red", "scalar_Green", "scalar_Blue"],
        ] {
            assert_eq!(triple(COLOR, &given), Some([1, 2, 3]), "{given:?}");
        }
        for given in [
            ["nx", "ny", "nz"],
            ["nxx", "ny", "nz"],
            ["normalx", "normaly", "normalz"],
            ["NormalX", "NormalY", "NormalZ"],
            ["normal_x", "normal_y", "normal_z"],
            ["scalar_Nx", "scalar_Ny", "scalar_Nz"],
        ] {
            assert_eq!(triple(NORMAL, &given), Some([0, 1, 2]), "{given:?}");
        }
        assert_eq!(triple(NORMAL, &["normal_x", "nx", "ny", "nz"]), Some([1, 2, 3]));
        assert_eq!(triple(COLOR, &["red", "green"]), None);
        assert_eq!(triple(COLOR, &["Rf", "Gf", "Bf", "Af"]), Some([0, 1, 2]));
        // One spelling for all three.
        assert_eq!(triple(COLOR, &["R", "G", "B", "r", "g"]), Some([0, 1, 2]));
        assert_eq!(triple(COLOR, &["R", "g", "B"]), Some([0, 1, 2]));
        assert_eq!(find(INTENSITY, ["Intensity", "intensity"].into_iter()), Some(1));
        assert_eq!(find(INTENSITY, ["scalar_Intensity_(mW)"].into_iter()), None);
    }

    #[test]
    fn each_channel_has_as_many_names() {
        assert!(COLOR.iter().all(|names| names.len() == COLOR[0].len()));
        assert!(NORMAL.iter().all(|names| names.len() == NORMAL[0].len()));
    }
}
