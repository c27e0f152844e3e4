//! The balance of a sphere's profile on a body: 1 on spheres and planes, closed forms on plates and at borders.

use glam::{DVec3, Vec3, dvec3};
use translucent::curvature::balance::{Tree, of_mesh};
use translucent::reference::profile::{Coefficients, Matter, Options, table::Local, tabulated};
use translucent::reference::walk::mesh::{Corners, Mesh};
use translucent::settings::Normalisation;
use translucent::shared::Material;

/// Channels of mean free paths 1, .5 and .25 and several albedos; their diffuse mean free paths are near 1.
const CHANNELS: [(f64, f64); 3] = [(0.84, 0.16), (1.9, 0.1), (4.0, 0.02)];
const LENGTH: f64 = 1.5;

struct Profiles {
    material: Material,
    tables: Vec<Vec3>,
}

impl Profiles {
    fn new() -> Profiles {
        let matter = CHANNELS.map(|(sigma_s_prime, sigma_a)| Coefficients {
            sigma_s_prime,
            sigma_a,
            g: 0.0,
            ior: 1.3,
            rough: None,
            appearance: None,
        });
        let options = Options {
            normalisation: Normalisation::Energy,
            radius_tail: 0.0,
            directional: Default::default(),
            precision: Default::default(),
        };
        let mut tables = vec![];
        let spheres: Vec<i32> = (-2..12).collect();
        let material = tabulated(&matter, options, &spheres, &mut tables);
        Profiles { material, tables }
    }

    fn at(&self, curvature: f64) -> Local<'_> {
        Local::new(Matter { material: &self.material, tables: &self.tables, curvature })
    }

    fn balance(&self, corners: &[Corners], curvature: f64, open: bool) -> Vec<[Vec3; 3]> {
        of_mesh(corners, &vec![Vec3::splat(curvature as f32); corners.len()], open, LENGTH, |c| self.at(c))
    }
}

fn corners(mesh: &Mesh) -> Vec<Corners> {
    (0..mesh.len()).map(|index| mesh.corners(index)).collect()
}

/// A square of `cells` x `cells` cells, half `half` wide.
fn square(half: f64, cells: usize) -> Vec<Corners> {
    let at = |i: usize, j: usize| {
        half * dvec3(2.0 * i as f64 / cells as f64 - 1.0, 2.0 * j as f64 / cells as f64 - 1.0, 0.0)
    };
    let cell = |i: usize, j: usize| {
        let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
        [[a, b, c], [a, c, d]]
    };
    (0..cells).flat_map(|i| (0..cells).flat_map(move |j| cell(i, j))).collect()
}

#[test]
fn is_one_on_spheres() {
    let profiles = Profiles::new();
    // The light that crosses a smaller one straight leaves at the end of its diameter, which facets cut off.
    for radius in [3.7, 20.0] {
        for sides in [24, 48] {
            let sphere = corners(&Mesh::capsule(radius, 0.0, sides));
            // An edge spans 2 pi / sides; areas and chords of facets are smaller by its square over 12.
            let facets = (std::f64::consts::TAU / sides as f64).powi(2) / 6.0;
            for balance in profiles.balance(&sphere, 1.0 / radius, false).into_iter().flatten() {
                let worst = (balance.as_dvec3() - 1.0).abs().max_element();
                assert!(worst < 0.015 + facets, "radius {radius}, {sides} sides: {balance}");
            }
        }
    }
}

#[test]
fn is_one_on_planes_but_at_their_borders() {
    let profiles = Profiles::new();
    let half = 40.0;
    for cells in [2, 20] {
        let set = square(half, cells);
        let [closed, open] = [false, true].map(|open| profiles.balance(&set, 0.0, open));
        for (triangle, (closed, open)) in set.iter().zip(closed.iter().zip(&open)) {
            for (corner, (closed, open)) in triangle.iter().zip(closed.iter().zip(open)) {
                if corner.abs().max_element() < half - 20.0 {
                    assert!((closed.as_dvec3() - 1.0).abs().max_element() < 0.01, "{cells}, {corner}: {closed}");
                }
                // What leaves over the border is in the matter behind.
                assert!(open.max_element() <= 1.0 && open.min_element() > 0.99, "{cells}, {corner}: {open}");
            }
        }
    }
    // On the border itself half of the disc is missing.
    let tree = square(half, 20);
    let (tree, plane) = (Tree::new(&tree), profiles.at(0.0));
    let found = tree.integral(&plane, dvec3(half, 0.3, 0.0), LENGTH);
    assert!((found * 2.0 / plane.total() - 1.0).abs().max_element() < 0.01, "{found}");
}

#[test]
fn a_plate_counts_twice_what_its_other_side_receives() {
    // From the middle of a wide plate of thickness h: T on this side and T - M(h) on the other.
    let profiles = Profiles::new();
    for (thickness, curvature) in [(0.3, 0.0), (0.3, 0.2), (1.0, 0.1), (3.0, 0.03)] {
        let local = profiles.at(curvature);
        let expected = 2.0 * local.total() - local.inside(thickness * thickness);
        for cells in [1, 41] {
            let plate = corners(&Mesh::cuboid(dvec3(120.0, 120.0, thickness), cells));
            let found = Tree::new(&plate).integral(&local, dvec3(0.2, 0.1, thickness / 2.0), LENGTH);
            let worst = (found / expected - 1.0).abs().max_element();
            assert!(worst < 0.01, "{thickness}, {curvature}, {cells} cells: {found} for {expected}");
        }
    }
}

#[test]
fn groups_stand_for_their_triangles() {
    // Of a box of twelve triangles each is integrated by its edges; of a fine one, most by their groups' centres.
    let profiles = Profiles::new();
    let [coarse, fine] = [1, 48].map(|cells| corners(&Mesh::cuboid(dvec3(4.0, 6.0, 2.0), cells)));
    let [coarse, fine] = [&coarse, &fine].map(|corners| Tree::new(corners));
    for (curvature, most) in [(0.0, 0.01), (0.1, 0.01), (0.7, 0.06)] {
        let local = profiles.at(curvature);
        for point in [dvec3(0.1, 0.2, 1.0), dvec3(1.98, 0.1, 1.0), dvec3(2.0, 2.99, 0.97), DVec3::ZERO] {
            let [exact, found] = [&coarse, &fine].map(|tree| tree.integral(&local, point, LENGTH));
            assert!(exact.min_element() > 0.0 && exact.max_element() <= 3.0 * local.total().max_element());
            let worst = (found / exact - 1.0).abs().max_element();
            println!("1/a {curvature}, {point}: {worst:.1e}");
            assert!(worst < most, "1/a {curvature}, {point}: {found} for {exact}");
        }
    }
}
