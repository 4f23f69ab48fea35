// The EWA low-pass: the kernel convolved with the pixel's Gaussian in the image (Heckbert 1989;
// Zwicker et al. 2001). With J the images of the half-axes, the ellipse of J J^T becomes that of Q
// = J J^T + BLUR I, and the weight is multiplied by sqrt(|J J^T| / |Q|). This is exact for a
// Gaussian kernel if the disk's image is approximated by the affine one at its centre. Same
// interface as lowpass_max.wgsl.
// Twin: src/passes/lowpass.rs.
// #import camera_orthographic|perspective::{Fragment, plane_depth}
// #import filter::{filter_rho2}
// #import filter|lowpass_none::{Filter}
// #import layout::{held}
// #import rows::{Homography}
// #import vectors::{dot2}

// (pixel's sigma / kernel's sigma)^2, pixels^2.
override FILTER_BLUR: f32;

fn low_pass(h: ptr<function, Homography>) -> Filter {
    if (!(*h).centered) {
        return Filter(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    }
    let s = (*h).s_image;
    let t = (*h).t_image;
    let xx = s.x * s.x + t.x * t.x + FILTER_BLUR;
    let xy = s.x * s.y + t.x * t.y;
    let yy = s.y * s.y + t.y * t.y + FILTER_BLUR;
    // |Q| = |J|^2 + BLUR trace(J J^T) + BLUR^2, in which nothing cancels.
    let area = s.x * t.y - s.y * t.x;
    let determinant = area * area + FILTER_BLUR * (dot2(s, s) + dot2(t, t)) + FILTER_BLUR * FILTER_BLUR;
    // x^T Q^-1 x = (sqrt(yy / |Q|) (x - y xy / yy))^2 + y^2 / yy.
    let r_xx = sqrt(yy / determinant);
    let center = vec2<f32>((*h).anchor) + 0.5 + (*h).offset;
    let extent = sqrt(vec2<f32>(xx, yy));
    (*h).low = center - extent;
    (*h).high = center + extent;
    let low = max((*h).depth_low, held.near);
    return Filter(
        (*h).offset.x,
        (*h).offset.y,
        low,
        max((*h).depth_high, low),
        r_xx,
        -r_xx * xy / yy,
        1.0 / sqrt(yy),
        // Positive even edge-on, because 0 means that there is no filter.
        max(abs(area) / sqrt(determinant), 1e-9),
    );
}

fn filtered(fragment: Fragment, abc: vec3<f32>, filter_: Filter, d: vec2<f32>) -> Fragment {
    if (filter_.gain == 0.0) {
        return fragment;
    }
    let rho2 = filter_rho2(filter_, d);
    return Fragment(rho2 <= 1.0, plane_depth(abc, filter_.depth_low, filter_.depth_high), rho2, filter_.gain, fragment.spot);
}
