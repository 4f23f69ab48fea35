//! 3D Gaussians, and an oracle for their pictures that shares no code with the program.
//!
//! The oracle multiplies the matrices of Kerbl et al. 2023 in f64, evaluates every Gaussian at
//! every pixel, and sorts them by the depths of their centres.

use epsplat::low_level::scene::{Camera, Projection};
use glam::{DMat2, DMat3, DVec2, DVec3};

use super::Random;
use super::gaussians::{Gaussian, composited, seen_color};

/// Variances that the oracle adds to an image, pixels squared, as the method's code does.
pub const DILATION: f64 = 0.3;

/// Gaussians in a ball of radius 1.2, of all shapes: standard deviations of the three axes are
/// 0.004 to 0.2, each for itself.
pub fn cloud(count: usize, degree: u32, seed: u64) -> Vec<Gaussian> {
    let mut random = Random(seed);
    let one = |_| {
        let position = loop {
            let at = DVec3::from_array([0, 1, 2].map(|_| random.between(-1.2, 1.2)));
            if at.length() < 1.2 {
                break at;
            }
        };
        Gaussian {
            position: position.as_vec3().to_array(),
            scales: (0..3).map(|_| random.between(0.004f64.ln(), 0.2f64.ln()) as f32).collect(),
            rotation: [0; 4].map(|_| random.between(-1.0, 1.0) as f32),
            opacity: random.between(-4.0, 5.0) as f32,
            base: [0; 3].map(|_| random.between(-1.5, 1.5) as f32),
            rest: (0..3 * ((degree + 1).pow(2) - 1)).map(|_| random.between(-0.3, 0.3) as f32).collect(),
        }
    };
    (0..count).map(one).collect()
}

/// The rotation matrix of a quaternion w, x, y, z of any length, as in the paper's supplement.
fn rotation(quaternion: [f32; 4]) -> DMat3 {
    let [w, x, y, z] = quaternion.map(f64::from);
    let norm = (w * w + x * x + y * y + z * z).sqrt();
    let [w, x, y, z] = [w / norm, x / norm, y / norm, z / norm];
    let rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ];
    DMat3::from_cols_array_2d(&rows).transpose()
}

/// A Gaussian as a camera sees it.
struct Seen {
    depth: f64,
    image: DVec2,
    /// The inverse of the image's covariance.
    conic: DMat2,
    alpha: f64,
    color: [f64; 3],
}

/// The variances that the oracle adds, and how it treats the third axis: the controls leave them
/// out.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    pub dilation: f64,
    pub third: bool,
    pub limited: bool,
}

impl Rules {
    pub const PUBLISHED: Self = Self { dilation: DILATION, third: true, limited: true };
}

fn seen(one: &Gaussian, camera: &Camera, rules: Rules) -> Option<Seen> {
    let center = DVec3::from_array(one.position.map(f64::from));
    let t = camera.rotation * (center - camera.eye);
    if t.z < camera.near {
        return None;
    }
    let mut variances: Vec<f64> = one.scales.iter().map(|scale| (2.0 * f64::from(*scale)).exp()).collect();
    if !rules.third {
        let least = (0..3).fold(2, |least, k| if variances[k] < variances[least] { k } else { least });
        variances[least] = 0.0;
    }
    let turn = rotation(one.rotation);
    let sigma = turn * DMat3::from_diagonal(DVec3::from_slice(&variances)) * turn.transpose();
    let in_camera = camera.rotation * sigma * camera.rotation.transpose();
    let (image, jacobian) = match camera.projection {
        Projection::Orthographic => {
            let image = [camera.fx * t.x + camera.cx, camera.fy * t.y + camera.cy];
            (image, [DVec3::X * camera.fx, DVec3::Y * camera.fy])
        }
        Projection::Pinhole => {
            // tan_fovx and limx of the method's code; the principal point may lie off centre.
            let limit = |slope: f64, size: u32, focal: f64, principal: f64| {
                let tan = 0.5 * f64::from(size) / focal;
                let off_center = (0.5 * f64::from(size) - principal) / focal;
                if rules.limited { slope.clamp(off_center - 1.3 * tan, off_center + 1.3 * tan) } else { slope }
            };
            let x = t.z * limit(t.x / t.z, camera.width, camera.fx, camera.cx);
            let y = t.z * limit(t.y / t.z, camera.height, camera.fy, camera.cy);
            let image = [camera.fx * t.x / t.z + camera.cx, camera.fy * t.y / t.z + camera.cy];
            let rows = [
                DVec3::new(camera.fx / t.z, 0.0, -camera.fx * x / (t.z * t.z)),
                DVec3::new(0.0, camera.fy / t.z, -camera.fy * y / (t.z * t.z)),
            ];
            (image, rows)
        }
    };
    let entry = |a: usize, b: usize| jacobian[a].dot(in_camera * jacobian[b]);
    let covariance =
        DMat2::from_cols_array(&[entry(0, 0) + rules.dilation, entry(0, 1), entry(1, 0), entry(1, 1) + rules.dilation]);
    // The method's code leaves out a Gaussian whose image has no area.
    if covariance.determinant() <= 0.0 {
        return None;
    }
    let direction = match camera.projection {
        Projection::Pinhole => (center - camera.eye).normalize(),
        Projection::Orthographic => camera.rotation.row(2),
    };
    Some(Seen {
        depth: t.z,
        image: DVec2::from_array(image),
        conic: covariance.inverse(),
        alpha: one.alpha(),
        color: seen_color(one, direction),
    })
}

/// Renders by the published formulas: sRGB codes premultiplied by alpha, and whether the pixel is
/// independent of rounding.
pub fn picture(gaussians: &[Gaussian], camera: &Camera, rules: Rules) -> Vec<([f64; 4], bool)> {
    let seen: Vec<Seen> = gaussians.iter().filter_map(|one| seen(one, camera, rules)).collect();
    let at = |pixel: u32| {
        let place = DVec2::new(f64::from(pixel % camera.width) + 0.5, f64::from(pixel / camera.width) + 0.5);
        let list = seen.iter().filter_map(|one| {
            let d = place - one.image;
            let power = -0.5 * d.dot(one.conic * d);
            let alpha = one.alpha * power.exp();
            // The logarithm of alpha over the least alpha that counts.
            let excess = (255.0 * one.alpha).ln() + power;
            let certain = excess.abs() > 1e-4 * (1.0 - power);
            let counts = alpha >= 1.0 / 255.0;
            (counts || !certain).then_some((one.depth, if counts { alpha.min(0.99) } else { 0.0 }, one.color, certain))
        });
        composited(list.collect())
    };
    (0..camera.pixels() as u32).map(at).collect()
}
