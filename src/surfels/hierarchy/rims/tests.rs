use super::*;
use crate::random::Random;

/// The bounds by a node hold for each disk below it, curved or not, on either side and however
/// steep.
#[test]
fn nodes_bound_their_disks() {
    let mut random = Random::stream(21, 0);
    let (mut tight, mut looked) = (0, 0);
    for _ in 0..4000 {
        let mut number = || 2.0 * random.number() - 1.0;
        let curved = [0.3, 0.1, -0.2].map(|height| height * number());
        let mut vector = || DVec3::new(number(), number(), number());
        let normal = vector().normalize();
        // Rounded to f32, as in `Shape::of`.
        let s = normal.any_orthonormal_vector().as_vec3().as_dvec3();
        let t = (normal.cross(s) * 0.3).as_vec3().as_dvec3();
        let normal = s.cross(t).normalize();
        let seen = [s, t].map(|axis| axis / axis.length_squared());
        let shape = Shape { s, t, seen };
        let curve = Curve::of(curved, [s, normal.cross(s), normal]);
        let bounding =
            Bounding { center: DVec3::ZERO, normal, shape, curve, scale: shape.scale(), bounds: NodeBounds::Rims };
        let lean = vector();
        let (middle, own) = (vector() * 3.0, (normal + 1.5 * lean).normalize());
        let spread = 0.5 * number().abs().powi(2);
        let disks: Vec<Disk> = (0..6)
            .map(|_| {
                let mut vector = || DVec3::new(number(), number(), number());
                let normal = (own + spread * vector()).normalize();
                let center = (middle + 0.2 * vector()).as_vec3();
                let s = normal.any_orthonormal_vector().as_vec3() * 0.1;
                let t = normal.as_vec3().cross(s) * 0.5;
                let cap = Cap([0.02 * number() as f32, 0.0, 0.0]);
                Disk { surfel: Surfel::ellipse(center, s, t), center: center.as_dvec3(), cap }
            })
            .collect();
        let one = own.any_orthonormal_vector();
        let surfel = Surfel::ellipse(middle.as_vec3(), one.as_vec3(), own.cross(one).as_vec3());
        let middle = DVec3::from_array(surfel.center.map(f64::from));
        let around = Bounding { center: middle, normal: normal_of(&surfel), ..bounding };
        let all =
            disks.iter().map(|disk| around.of(disk, &Bound::NOTHING, &Bound::ALL)).fold(Bound::NOTHING, Bound::both);
        let node = Node {
            surfel,
            cap: Cap::FLAT,
            color: [1.0; 4],
            radius: (all.radius * ROUNDED_UP) as f32,
            cone: cone(true, all.cosine),
            first: 0,
            count: 6,
            leaf: true,
        };
        let told = bounding.of_node(&node, [0.0; 3]);
        for disk in &disks {
            let own = bounding.of(disk, &Bound::NOTHING, &Bound::ALL);
            assert!(own.rim <= told.rim && own.radius <= told.radius && own.cosine >= told.cosine);
            tight += usize::from(own.rim > 0.5 * told.rim);
            looked += 1;
        }
    }
    assert!(tight > looked / 4, "{tight} of {looked}");
}

/// The ellipse of a node of squares holds all corners of the squares about the disks below it,
/// and one corner lies on its rim; the bound by a node below is no less.
#[test]
fn squares_bound_corners() {
    let mut random = Random::stream(22, 0);
    let (mut off, mut tight) = (0, 0);
    for _ in 0..500 {
        let mut number = || 2.0 * random.number() - 1.0;
        let mut vector = || DVec3::new(number(), number(), number());
        let normal = vector().normalize();
        let s = normal.any_orthonormal_vector().as_vec3().as_dvec3();
        let t = (normal.cross(s) * 0.4).as_vec3().as_dvec3();
        let normal = s.cross(t).normalize();
        let shape = Shape { s, t, seen: [s, t].map(|axis| axis / axis.length_squared()) };
        let curve = Curve::of([0.0; 3], [s, normal.cross(s), normal]);
        let bounds = NodeBounds::Squares;
        let of = |center: DVec3| Bounding { center, normal, shape, curve, scale: shape.scale(), bounds };
        let disks: Vec<Disk> = (0..6)
            .map(|_| {
                let own = (normal + 0.5 * vector()).normalize();
                let center = vector().as_vec3();
                let s = own.any_orthonormal_vector().as_vec3() * 0.2;
                let t = own.as_vec3().cross(s) * 0.5;
                Disk { surfel: Surfel::ellipse(center, s, t), center: center.as_dvec3(), cap: Cap::FLAT }
            })
            .collect();
        let around = |of: &Bounding| {
            let one = |disk: &Disk| of.of(disk, &Bound::NOTHING, &Bound::ALL);
            disks.iter().map(one).fold(Bound::NOTHING, Bound::both)
        };
        let all = around(&of(DVec3::ZERO));
        // Corners by their own formula: the ellipse grown by `rim` has (p.s)^2 + (p.t)^2 = 1.
        let corners = disks.iter().flat_map(|disk| {
            let [s, t] = [disk.surfel.s, disk.surfel.t].map(|axis| DVec3::from_array(axis.map(f64::from)));
            [s + t, s - t, t - s, -s - t].map(|beside| {
                let offset = disk.center + beside;
                let offset = offset - offset.dot(normal) * normal;
                let along = |axis: DVec3| offset.dot(axis) / (axis.length_squared() * all.rim);
                along(shape.s).hypot(along(shape.t))
            })
        });
        let farthest = corners.fold(0.0, f64::max);
        assert!((farthest - 1.0).abs() < 1e-9, "{farthest}");
        // Rims of the disks reach less far than corners: not what is bounded here.
        let rims = around(&Bounding { bounds: NodeBounds::Rims, ..of(DVec3::ZERO) });
        off += usize::from((rims.rim / all.rim - 1.0).abs() > 0.01);

        let middle = vector().as_vec3();
        let own = of(middle.as_dvec3());
        let below = around(&own);
        let node = Node {
            surfel: Surfel::ellipse(middle, shape.s.as_vec3(), shape.t.as_vec3()),
            cap: Cap::FLAT,
            color: [1.0; 4],
            radius: (below.radius * ROUNDED_UP) as f32,
            cone: cone(true, below.cosine),
            first: 0,
            count: 6,
            leaf: true,
        };
        let told = of(DVec3::ZERO).of_node(&node, [0.0; 3]);
        assert!(all.rim <= told.rim && all.radius <= told.radius && all.cosine >= told.cosine);
        tight += usize::from(all.rim > 0.1 * told.rim);
    }
    assert!(off > 400 && tight > 100, "{off} {tight}");
}

/// The angle between normals and that of the cone add up, below and beyond 180 degrees.
#[test]
fn angles_of_nodes_add_up() {
    let shape = Shape { s: DVec3::X, t: DVec3::Y, seen: [DVec3::X, DVec3::Y] };
    let curve = Curve::of([0.0; 3], [DVec3::X, DVec3::Y, DVec3::Z]);
    let bounding =
        Bounding { center: DVec3::ZERO, normal: DVec3::Z, shape, curve, scale: 1.0, bounds: NodeBounds::Rims };
    let of = |angle: f64, cone: f32| {
        let (sine, cosine) = angle.sin_cos();
        let surfel = Surfel { center: [0.0; 3], s: [cosine as f32, 0.0, -sine as f32], t: [0.0, 1.0, 0.0] };
        let (cap, color) = (Cap::FLAT, [1.0; 4]);
        bounding.of_node(&Node { surfel, cap, color, radius: 1.0, cone, first: 0, count: 1, leaf: true }, [0.0; 3])
    };
    for angle in (0..=32).map(|k| f64::from(k) * PI / 32.0) {
        for cone in (0..=32).map(|k| f64::from(k) * PI / 32.0) {
            let bound = of(angle, cone.cos() as f32);
            let expected = (angle + cone + 1e-3).min(PI);
            assert!((bound.cosine - expected.cos()).abs() < 1e-6, "{angle} {cone}: {}", bound.cosine);
            let slope = if expected < STEEPEST.atan() { expected.tan() } else { STEEPEST };
            assert!((bound.rim / (1.0 + slope) - 1.0).abs() < 1e-4, "{angle} {cone}: {}", bound.rim);
        }
        // A full cone contains every normal, whatever the node's own is.
        assert_eq!(of(angle, -1.0).cosine, -1.0);
    }
}
