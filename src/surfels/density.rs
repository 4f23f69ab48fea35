//! The density of points on their surface.

use std::f64::consts::PI;

use glam::DVec3;
use rayon::prelude::*;

use super::LARGEST_COORDINATE;
use super::neighbours::NeighbourSearch;
use super::positions::DistinctPositions;
use crate::Result;
use crate::io::Points;
use crate::scene::Bounds;

/// The number of neighbours within the circle whose area is taken.
const COUNT: usize = 8;

/// Positions that one task searches for.
const TOGETHER: usize = 1 << 10;

/// Returns the number of points per square unit at each point of each input: n / (pi r²), where r
/// is the distance to the n-th nearest other position of all inputs together, n = 8, or fewer if
/// there are fewer. It is NaN for points without finite coordinates, and for a single position.
///
/// # Errors
///
/// [`Error::Usage`](crate::Error::Usage) for more than 2^32 - 1 points.
pub(crate) fn densities(inputs: &[Points]) -> Result<Vec<Vec<f64>>> {
    let is_usable = |p: &[f64; 3]| p.iter().all(|c| c.abs() <= LARGEST_COORDINATE);
    let positions: Vec<[f64; 3]> =
        inputs.iter().flat_map(|input| &input.positions).filter(|p| is_usable(p)).copied().collect();
    let bounds = Bounds::of(positions.par_iter().map(|p| DVec3::from_array(*p)));
    let distinct = DistinctPositions::new(&positions, &bounds, bounds.min)?;
    drop(positions);
    let search = NeighbourSearch::new(&distinct, COUNT);
    let scale = distinct.scale();
    let density = |index: usize, found: &mut Vec<_>| {
        search.nearest(index as u32, found);
        let farthest = found.last().map(|neighbour| neighbour.squared_distance / (scale * scale));
        farthest.map_or(f64::NAN, |squared| found.len() as f64 / (PI * squared))
    };
    let starts: Vec<usize> = (0..distinct.len()).step_by(TOGETHER).collect();
    let of_range = |start: usize| {
        let mut found = Vec::new();
        (start..distinct.len().min(start + TOGETHER)).map(|index| density(index, &mut found)).collect::<Vec<f64>>()
    };
    let of_positions = starts.into_par_iter().map(of_range).collect::<Vec<_>>().concat();
    let mut places = distinct.of_point().iter();
    let mut of_point = |position: &[f64; 3]| match is_usable(position) {
        true => places.next().map_or(f64::NAN, |place| of_positions[*place as usize]),
        false => f64::NAN,
    };
    Ok(inputs.iter().map(|input| input.positions.iter().map(&mut of_point).collect()).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_density_of_a_grid_is_that_of_its_squares() {
        // Squares of side 0.5: four points per square unit. The eighth neighbour of a point inside
        // is its diagonal one, at 0.5 * sqrt(2), so the estimate is 8 / (pi / 2).
        let grid = |from: i32, to: i32| Points {
            positions: (from..to)
                .flat_map(|x| (0..9).map(move |y| [7e6 + 0.5 * f64::from(x), 0.5 * f64::from(y), 3.0]))
                .collect(),
            ..Points::default()
        };
        // Two inputs: the points at their seam have neighbours in both.
        let mut right = grid(5, 9);
        right.positions.push([f64::NAN; 3]);
        let densities = densities(&[grid(0, 5), right]).unwrap();
        assert_eq!((densities[0].len(), densities[1].len()), (45, 37));
        for density in [densities[0][4 * 9 + 4], densities[0][3 * 9 + 5], densities[1][4]] {
            assert!((density - 16.0 / PI).abs() < 1e-9, "{density}");
        }
        assert!(densities[0][0] < 16.0 / PI && densities[1][36].is_nan());
        let one = Points { positions: vec![[1.0; 3]; 3], ..Points::default() };
        assert!(super::densities(&[one]).unwrap()[0].iter().all(|density| density.is_nan()));
    }
}
