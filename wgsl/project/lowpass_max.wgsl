// The larger of the object-space kernel and a round screen-space one, which is the one of smaller
// rho (Botsch et al. 2005, section 4.2). Same interface as lowpass_ewa.wgsl.
// Twin: src/passes/lowpass.rs.
// #import camera_orthographic|perspective::{Fragment, plane_depth}
// #import filter::{filter_rho2}
// #import filter|lowpass_none::{Filter}
// #import layout::{held}
// #import rows::{Homography}

// Design::radius in the twin, pixels.
override FILTER_RADIUS: f32;

fn low_pass(h: ptr<function, Homography>) -> Filter {
    if (!(*h).centered) {
        return Filter(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    }
    let center = vec2<f32>((*h).anchor) + 0.5 + (*h).offset;
    (*h).low = min((*h).low, center - FILTER_RADIUS);
    (*h).high = max((*h).high, center + FILTER_RADIUS);
    let r = 1.0 / FILTER_RADIUS;
    let low = max((*h).depth_low, held.near);
    let high = max((*h).depth_high, low);
    return Filter((*h).offset.x, (*h).offset.y, low, high, r, 0.0, r, 1.0);
}

fn filtered(fragment: Fragment, abc: vec3<f32>, filter_: Filter, d: vec2<f32>) -> Fragment {
    let rho2 = filter_rho2(filter_, d);
    if (filter_.gain == 0.0 || rho2 > 1.0 || rho2 >= fragment.rho2) {
        return fragment;
    }
    return Fragment(true, plane_depth(abc, filter_.depth_low, filter_.depth_high), rho2, 1.0, fragment.spot);
}
