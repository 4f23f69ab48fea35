//! Files of Gaussians, and an oracle for their pictures that shares no code with the program.
//!
//! The oracle intersects rays and planes in f64, evaluates harmonics by associated Legendre
//! polynomials, and sorts all fragments.

use std::f64::consts::PI;

use epsplat::low_level::scene::Camera;
use glam::{DQuat, DVec3};

use super::Random;

/// A Gaussian as stored in a file.
#[derive(Clone, Debug)]
pub struct Gaussian {
    pub position: [f32; 3],
    /// Logarithms of two or three standard deviations.
    pub scales: Vec<f32>,
    /// Quaternion w, x, y, z.
    pub rotation: [f32; 4],
    /// Opacity before the logistic function.
    pub opacity: f32,
    pub base: [f32; 3],
    /// Higher harmonics: all of red, then of green, then of blue.
    pub rest: Vec<f32>,
}

impl Gaussian {
    /// A round Gaussian of standard deviation `sigma` and one colour that faces along z.
    pub fn round(position: [f32; 3], sigma: f32, opacity: f64, color: [f64; 3]) -> Self {
        Self {
            position,
            scales: vec![sigma.ln(); 2],
            rotation: [1.0, 0.0, 0.0, 0.0],
            opacity: (opacity / (1.0 - opacity)).ln() as f32,
            base: color.map(|c| ((c - 0.5) * 2.0 * PI.sqrt()) as f32),
            rest: Vec::new(),
        }
    }

    /// The opacity, from the stored f32.
    pub fn alpha(&self) -> f64 {
        1.0 / (1.0 + (-f64::from(self.opacity)).exp())
    }
}

/// Encodes the Gaussians as a binary PLY file.
pub fn file(gaussians: &[Gaussian]) -> Vec<u8> {
    let first = &gaussians[0];
    let mut names: Vec<String> =
        ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"].map(String::from).into();
    names.extend((0..first.rest.len()).map(|k| format!("f_rest_{k}")));
    names.push("opacity".into());
    names.extend((0..first.scales.len()).map(|k| format!("scale_{k}")));
    names.extend((0..4).map(|k| format!("rot_{k}")));
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let count = gaussians.len();
    let header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}end_header\n");
    let mut bytes = header.into_bytes();
    for one in gaussians {
        let rows: [&[f32]; 7] =
            [&one.position, &[0.0; 3], &one.base, &one.rest, &[one.opacity], &one.scales, &one.rotation];
        rows.iter().copied().flatten().for_each(|value| bytes.extend(value.to_le_bytes()));
    }
    bytes
}

/// Gaussians near a torus of radii 1 and 0.4, most of them on its surface, with harmonics of degree
/// `degree`.
pub fn torus(count: usize, degree: u32, seed: u64) -> Vec<Gaussian> {
    let mut random = Random(seed);
    let spacing = (4.0 * PI * PI * 0.4 / count as f64).sqrt();
    let one = |_| {
        let [around, across] = [0, 1].map(|_| random.between(0.0, 2.0 * PI));
        let normal = DVec3::new(around.cos() * across.cos(), around.sin() * across.cos(), across.sin());
        let position = DVec3::new(around.cos(), around.sin(), 0.0) + 0.4 * normal;
        let tilt = DVec3::new(random.between(-0.2, 0.2), random.between(-0.2, 0.2), random.between(-0.2, 0.2));
        let turn = DQuat::from_rotation_arc(DVec3::Z, (normal + tilt).normalize())
            * DQuat::from_rotation_z(random.between(0.0, PI));
        let length = random.between(0.5, 2.0);
        let band = |shift: f64| (2.0 * PI.sqrt() * 0.35 * (4.0 * position.x + 3.0 * position.z + shift).sin()) as f32;
        Gaussian {
            position: position.as_vec3().to_array(),
            scales: [0.7, 0.45].map(|size| (spacing * size * random.between(0.6, 1.4)).ln() as f32).into(),
            rotation: [turn.w, turn.x, turn.y, turn.z].map(|c| (length * c) as f32),
            opacity: random.between(-4.0, 9.0) as f32,
            base: [band(0.0), band(2.0), band(4.0)],
            rest: (0..3 * ((degree + 1).pow(2) - 1)).map(|_| random.between(-0.3, 0.3) as f32).collect(),
        }
    };
    (0..count).map(one).collect()
}

/// The real spherical harmonic of degree `l` and order `m`, with the Condon-Shortley factor (-1)^m.
pub fn harmonic(l: i32, m: i32, direction: DVec3) -> f64 {
    let order = m.abs();
    let (cosine, sine) = (direction.z, direction.truncate().length());
    // The recurrence starts at P_m^m and goes up in degree.
    let (mut below, mut own) = (0.0, (1..=order).map(|k| -f64::from(2 * k - 1) * sine).product::<f64>());
    for degree in order + 1..=l {
        let next = (f64::from(2 * degree - 1) * cosine * own - f64::from(degree + order - 1) * below)
            / f64::from(degree - order);
        (below, own) = (own, next);
    }
    let factorials: f64 = (l - order + 1..=l + order).map(f64::from).product();
    let norm = (f64::from(2 * l + 1) / (4.0 * PI) / factorials).sqrt();
    let angle = f64::from(order) * direction.y.atan2(direction.x);
    match m {
        0 => norm * own,
        _ if m < 0 => 2f64.sqrt() * norm * own * angle.sin(),
        _ => 2f64.sqrt() * norm * own * angle.cos(),
    }
}

/// The colour of a Gaussian, in sRGB codes, along a direction of unit length from the eye.
pub fn seen_color(gaussian: &Gaussian, direction: DVec3) -> [f64; 3] {
    let terms = gaussian.rest.len() / 3;
    [0, 1, 2].map(|channel| {
        let mut value = 0.5 + harmonic(0, 0, direction) * f64::from(gaussian.base[channel]);
        let orders = (1..4).flat_map(|l| (-l..=l).map(move |m| (l, m)));
        for ((l, m), rest) in orders.zip(&gaussian.rest[channel * terms..(channel + 1) * terms]) {
            value += f64::from(*rest) * harmonic(l, m, direction);
        }
        value.max(0.0)
    })
}

/// A Gaussian prepared for the oracle's camera.
struct Seen {
    center: DVec3,
    /// Unit vectors along its two axes.
    axes: [DVec3; 2],
    sigmas: [f64; 2],
    alpha: f64,
    color: [f64; 3],
    image: [f64; 2],
    /// The least and greatest depth of its disk.
    depths: [f64; 2],
}

/// Radius in standard deviations beyond which alpha is below 1/255: sqrt(2 ln 255).
fn extent() -> f64 {
    (2.0 * 255f64.ln()).sqrt()
}

impl Seen {
    fn of(gaussian: &Gaussian, camera: &Camera) -> Self {
        let center = DVec3::from_array(gaussian.position.map(f64::from));
        let [w, x, y, z] = gaussian.rotation.map(f64::from);
        let turn = DQuat::from_xyzw(x, y, z, w).normalize();
        let axes = [turn * DVec3::X, turn * DVec3::Y];
        let sigmas = [0, 1].map(|k| f64::from(gaussian.scales[k]).exp());
        let direction = (center - camera.eye).normalize();
        let color = seen_color(gaussian, direction);
        let seen = camera.to_camera(center);
        let image = [camera.fx * seen.x / seen.z + camera.cx, camera.fy * seen.y / seen.z + camera.cy];
        let along = |k: usize| extent() * sigmas[k] * camera.rotation.row(2).dot(axes[k]);
        let half = along(0).hypot(along(1));
        Self { center, axes, sigmas, alpha: gaussian.alpha(), color, image, depths: [seen.z - half, seen.z + half] }
    }

    /// Returns depth, alpha and whether they are certain at an image position (a pixel's centre).
    fn at(&self, camera: &Camera, [x, y]: [f64; 2]) -> Option<(f64, f64, bool)> {
        let ray = camera.ray(x, y);
        let normal = self.axes[0].cross(self.axes[1]);
        let depth = normal.dot(self.center - camera.eye) / normal.dot(ray);
        let offset = camera.eye + depth * ray - self.center;
        let disk = [0, 1].map(|k| (offset.dot(self.axes[k]) / self.sigmas[k]).powi(2)).iter().sum::<f64>();
        let round = 2.0 * ((x - self.image[0]).powi(2) + (y - self.image[1]).powi(2));
        let rho2 = if depth > 0.0 { disk.min(round) } else { round };
        let alpha = self.alpha * (-0.5 * rho2).exp();
        let certain = (alpha * 255.0 - 1.0).abs() > 1e-4;
        // A plane that recedes past infinity counts as infinitely far.
        let plane = if depth > 0.0 { depth } else { f64::INFINITY };
        let depth = if disk <= round { plane } else { plane.clamp(self.depths[0], self.depths[1]) };
        (rho2 <= extent().powi(2) && alpha >= 1.0 / 255.0)
            .then_some((depth, alpha.min(0.99), certain))
            .or_else(|| (!certain).then_some((depth, 0.0, false)))
    }
}

/// Renders by the published formulas: sRGB codes premultiplied by alpha, and whether the pixel is
/// independent of rounding.
pub fn picture(gaussians: &[Gaussian], camera: &Camera) -> Vec<([f64; 4], bool)> {
    let mut lists = vec![Vec::new(); camera.pixels()];
    for seen in gaussians.iter().map(|gaussian| Seen::of(gaussian, camera)) {
        // Half the width of the searched square, pixels: the radius of a bounding sphere, and at
        // least that of the low-pass.
        let nearest = seen.depths[0].max(1e-3);
        let reach = (extent() * seen.sigmas[0].max(seen.sigmas[1]) * camera.fx / nearest * 1.5).max(4.0);
        let range = |k: usize, size: u32| {
            let last = f64::from(size) - 1.0;
            (seen.image[k] - reach).clamp(0.0, last) as u32..=(seen.image[k] + reach).clamp(0.0, last) as u32
        };
        for y in range(1, camera.height) {
            for x in range(0, camera.width) {
                if let Some((depth, alpha, certain)) = seen.at(camera, [x, y].map(|c| f64::from(c) + 0.5)) {
                    lists[(y * camera.width + x) as usize].push((depth, alpha, seen.color, certain));
                }
            }
        }
    }
    lists.into_iter().map(composited).collect()
}

/// Composites fragments of depth, alpha, colour and certainty from front to back.
pub fn composited(mut list: Vec<(f64, f64, [f64; 3], bool)>) -> ([f64; 4], bool) {
    list.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut certain = list.iter().all(|fragment| fragment.3);
    certain &= list.windows(2).all(|pair| pair[1].0 / pair[0].0 - 1.0 > 2e-6);
    let (mut shown, mut transmittance) = ([0.0; 4], 1.0);
    for (_, alpha, [r, g, b], _) in list {
        let next = transmittance * (1.0 - alpha);
        certain &= (next / 1e-4 - 1.0).abs() > 1e-3;
        if next < 1e-4 {
            break;
        }
        for (sum, value) in shown.iter_mut().zip([r, g, b, 1.0]) {
            *sum += transmittance * alpha * value;
        }
        transmittance = next;
    }
    (shown, certain)
}
