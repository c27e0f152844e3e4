//! The locally alike sphere: exact on spheres, a plane where a body is flat and thick, closed forms on plates.

use glam::{DVec3, dvec3};
use translucent::curvature::of_mesh;
use translucent::reference::math::integrate;
use translucent::reference::walk::mesh::{Corners, Mesh};

#[test]
fn a_sphere_is_its_own() {
    let mesh = Mesh::capsule(2.0, 0.0, 48);
    let corners: Vec<Corners> = (0..mesh.len()).map(|index| mesh.corners(index)).collect();
    for length in [1.0, 4.0, 20.0, 1e6] {
        // Facets are flat: what lies within one is not seen.
        for radius in of_mesh(&corners, length, 64) {
            assert!((radius * 2.0 - 1.0).abs().max_element() < 0.05, "L {length}: 1/a {radius}");
        }
    }
}

#[test]
fn a_plate_is_a_plane_unless_it_is_thin() {
    // In the middle of a wide plate of thickness h: G = 2 E_3(h / L).
    let (length, width) = (1.0, 60.0);
    for (thickness, count) in [(0.5, 1), (2.0, 1), (10.0, 1)] {
        let mesh = Mesh::cuboid(dvec3(width, width, thickness), 3);
        let corners: Vec<Corners> = (0..mesh.len()).map(|index| mesh.corners(index)).collect();
        let g = integrate(0.0, 1.0, 8, |cos| 2.0 * cos * (-thickness / (length * cos)).exp());
        let found = of_mesh(&corners, length, 64);
        let middle = corners.iter().zip(found).filter(|(t, _)| {
            let centre = (t[0] + t[1] + t[2]) / 3.0;
            centre.truncate().length() < 5.0 * f64::from(count) && t.iter().all(|c| c.z.abs() == thickness / 2.0)
        });
        let mut seen = 0;
        for (_, inverse) in middle {
            seen += 1;
            let x = 2.0 / (length * f64::from(inverse.x));
            let expected = 2.0 * (1.0 - (1.0 + x) * (-x).exp()) / (x * x);
            // Sixty-four directions; grazing ones count little.
            assert!((expected - g).abs() < 2e-3 + 0.02 * g, "h {thickness}: G {expected} for {g}");
        }
        assert!(seen > 0, "no triangle in the middle");
    }
}

#[test]
fn open_surfaces_are_half_spaces() {
    let square: [Corners; 2] =
        [[DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y], [DVec3::ZERO, DVec3::X + DVec3::Y, DVec3::Y]];
    for inverse in of_mesh(&square, 0.5, 16) {
        assert!(inverse.max_element() < 1e-9, "{inverse}");
    }
}

/// Two bodies that share a face: between its two sides there is nothing, and yet every number is one.
#[test]
fn bodies_that_touch_have_finite_curvatures() {
    let mesh = Mesh::cuboid(DVec3::ONE, 2);
    let own = || (0..mesh.len()).map(|index| mesh.corners(index));
    let corners: Vec<Corners> = own().chain(own().map(|t| t.map(|corner| corner + DVec3::X))).collect();
    let found = of_mesh(&corners, 0.7, 64);
    let most = found.iter().map(|inverse| inverse.max_element()).fold(0.0, f32::max);
    assert!(found.iter().all(|inverse| inverse.is_finite() && inverse.min_element() > 0.0), "{most}");
    assert!(most <= (1 << 20) as f32, "{most}");
}

/// Of a fine mesh fewer places are looked at than it has triangles.
#[test]
fn a_fine_mesh_has_the_curvatures_of_a_coarse_one() {
    let size = dvec3(1.0, 0.8, 0.3);
    let of = |cells| {
        let mesh = Mesh::cuboid(size, cells);
        let corners: Vec<Corners> = (0..mesh.len()).map(|index| mesh.corners(index)).collect();
        let found = of_mesh(&corners, 0.2, 64);
        let all: Vec<(DVec3, f32)> =
            corners.iter().zip(found).flat_map(|(t, inverse)| t.iter().copied().zip(inverse.to_array())).collect();
        (corners.len(), all)
    };
    let ((few, coarse), (many, fine)) = (of(12), of(72));
    assert!(few < 1 << 14 && many > 1 << 14);
    // Beside an edge both are means over what lies near, which changes fast there.
    let inner = |corner: DVec3| (size / 2.0 - corner.abs()).to_array().iter().filter(|&&way| way > 0.1).count() == 2;
    let mut seen = 0;
    for (corner, inverse) in coarse.into_iter().filter(|&(corner, _)| inner(corner)) {
        let (_, same) = fine.iter().find(|(other, _)| other.distance(corner) < 1e-9).expect("a vertex of both");
        let off = f64::from(same / inverse) - 1.0;
        assert!(off.abs() < 0.03, "{corner}: {inverse} and {same}");
        seen += 1;
    }
    assert!(seen > 100, "{seen} vertices");
}
