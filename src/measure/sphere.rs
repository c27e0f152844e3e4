//! Spheres under radiance 1 from everywhere.
//!
//! The area of a sphere within the chord r of a point is pi r^2, as on a plane. So every point of a sphere of radius a
//! gathers the profile's mass within 2a, whatever the profile, and the whole disk up to the silhouette is flat.

use super::{
    Axis, CHANNELS, Figure, Matter, Panel, Point, Series, Setup, channel,
    figure::{even, geometric},
    mean_and_error, scene_in_uniform_light,
    scenes::{Eye, Mesh, gltf},
};
use crate::{error::Result, image::Image, settings::Settings};
use glam::DVec3;

/// Pixels of an edge of the image.
const SIZE: u32 = 64;
/// Half the image's side, in radii.
const VIEW: f64 = 1.02;
/// Subdivisions of the octahedron.
const SUBDIVISIONS: u32 = 64;
/// Radii over the mean free path of the green channel.
const RADII: [f64; 6] = [0.5, 1.5, 5.0, 15.0, 50.0, 150.0];
/// Rings of the disk.
const RINGS: usize = 8;
/// The outermost pixels that count, in radii: farther out the mesh's silhouette shows.
const RIM: f64 = 0.97;

/// Lo / (Ft Li), its mean over the disk by radius, and by place on the disk.
pub fn sphere(setup: &Setup) -> Result<Figure> {
    let path = setup.matters[0].mean_free_path().y;
    let mesh = Mesh::sphere(1.0, SUBDIVISIONS);
    // As large as the sphere that it stands for.
    let inflated = (4.0 * std::f64::consts::PI / area(&mesh)).sqrt();
    let (mut means, mut flat) = (vec![], vec![]);
    for matter in setup.matters {
        let channels = setup.channels(matter);
        let mut points = vec![vec![]; channels.len()];
        for factor in RADII {
            let radius = factor * path;
            let mut mesh = mesh.clone();
            mesh.positions.iter_mut().for_each(|p| *p *= radius * inflated);
            let eye = Eye { eye: DVec3::new(0.0, 0.0, 10.0 * radius), at: DVec3::ZERO, lens: -VIEW * radius };
            let materials = std::slice::from_ref(&matter.material);
            let scene = scene_in_uniform_light(&gltf(&[(mesh, 0)], materials, &[], &eye))?;
            let settings = Settings { resolution: Some((SIZE, SIZE)), reuse: Some(1), ..Settings::default() };
            let image = setup.render(matter, &scene, settings, setup.samples(64))?;
            for ((c, _), points) in channels.iter().zip(&mut points) {
                let disk = disk(matter, &image, *c);
                let (measured, error) = mean_and_error(&disk.iter().map(|(_, value)| *value).collect::<Vec<_>>());
                let expected = matter.profile(*c).cdf(2.0 * radius);
                points.push(Point { x: radius, measured, error, expected });
                if *c == 1 {
                    flat.push(rings(&disk, measured, format!("{}a = {factor} mfp", setup.prefix(matter))));
                }
            }
        }
        for ((c, name), points) in channels.into_iter().zip(points) {
            let radii = geometric(0.3 * path, 300.0 * path, 200);
            let curve = radii.into_iter().map(|radius| (radius, matter.profile(c).cdf(2.0 * radius))).collect();
            means.push(Series { name, points, curve }.up_to_where_known(matter));
        }
    }
    let by_radius = Panel {
        name: "mean of the disk".into(),
        x: Axis::logarithmic("radius a [mm]"),
        y: Axis::linear("Lo / (Ft Li)"),
        series: means,
    };
    let by_place = Panel {
        name: "flatness, G".into(),
        x: Axis::linear("distance from the middle of the disk [a]"),
        y: Axis::linear("Lo / Ft over its mean"),
        series: flat,
    };
    let triangles = 8 * SUBDIVISIONS * SUBDIVISIONS;
    let note = format!("the sphere is a mesh of {triangles} triangles with the sphere's area");
    Ok(Figure { title: setup.title("Sphere in uniform light"), panels: vec![by_radius, by_place], notes: vec![note] })
}

fn area(mesh: &Mesh) -> f64 {
    let corner = |i: u32| mesh.positions[i as usize];
    let triangle = |t: &[u32]| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).length() / 2.0;
    mesh.indices.chunks_exact(3).map(triangle).sum()
}

/// Distance from the middle over the radius, and Lo / (Ft Li), of each pixel of the disk.
fn disk(matter: &Matter, image: &Image, c: usize) -> Vec<(f64, f64)> {
    let light = channel(image, &format!("subsurface.{}", CHANNELS[c]));
    let half = f64::from(SIZE) / 2.0;
    let distance = |x: f64, y: f64| VIEW * (x / half - 1.0).hypot(y / half - 1.0);
    let mut disk = vec![];
    for (i, light) in light.into_iter().enumerate() {
        let (x, y) = ((i as u32 % SIZE) as f64, (i as u32 / SIZE) as f64);
        if distance(x + 0.5, y + 0.5) > RIM {
            continue;
        }
        // The mean of Ft over the pixel, which is what it shows.
        let within = (0..64).map(|k| distance(x + (f64::from(k % 8) + 0.5) / 8.0, y + (f64::from(k / 8) + 0.5) / 8.0));
        let leaving = within.map(|d| matter.transmittance((1.0 - d * d).max(0.0).sqrt())).sum::<f64>() / 64.0;
        disk.push((distance(x + 0.5, y + 0.5), light / leaving));
    }
    disk
}

/// Means over rings of equal width, over the mean of all.
fn rings(disk: &[(f64, f64)], mean: f64, name: String) -> Series {
    let points = (0..RINGS).map(|ring| {
        let within = |d: f64| (d / RIM * RINGS as f64) as usize == ring;
        let values: Vec<f64> = disk.iter().filter(|(d, _)| within(*d)).map(|(_, value)| value / mean).collect();
        let (measured, error) = mean_and_error(&values);
        Point { x: (ring as f64 + 0.5) / RINGS as f64 * RIM, measured, error, expected: 1.0 }
    });
    let curve = even(0.0, 1.0, 2).into_iter().map(|x| (x, 1.0)).collect();
    Series { name, points: points.collect(), curve }
}
